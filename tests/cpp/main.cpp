// SPDX-License-Identifier: MIT
// main() of every C++ test, and doctest's own code: compiled once, since it takes longer than most tests do.
#define DOCTEST_CONFIG_IMPLEMENT_WITH_MAIN
#include <doctest/doctest.h>
