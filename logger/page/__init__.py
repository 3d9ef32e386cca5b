"""The page for a phone in the Pi's own Wi-Fi: it shows the recording and cannot disturb it.

A process and a user of its own. It reads status.json and the runs, and writes only requests to
follow a cell or to mark a place (`logger.device.page_requests`).
"""
