# SPDX-License-Identifier: MIT
"""Stores: building and opening them, and the sessions that select, draw and capture; meshes of cuts as files."""
