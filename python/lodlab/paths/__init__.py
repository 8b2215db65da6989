# SPDX-License-Identifier: MIT
"""Camera paths: built-in ones over the ground below, and those of key frames."""
