"""The page for a phone in the Pi's own Wi-Fi: it shows the recording and cannot disturb it.

A process of its own with a user of its own. It reads status.json and the runs, and writes nothing
but requests to follow a cell or to mark a place (`logger.device.page_requests`).
"""
