# SPDX-License-Identifier: MIT
"""Scenes whose figures are known on paper: what `calibrate` builds, draws and measures."""
