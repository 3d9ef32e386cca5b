"""Drivers of Huawei modems."""
