// SPDX-License-Identifier: MIT
// The method that scripts/new_method.py makes, as it makes it: tests/adversaries/test_made_anew.py holds it
// to the contract. The build folder has its sources (new_method/).
#include "method/method.h"

namespace lodlab {

const Method& made_anew_method();

namespace {

const bool kRegistered = (register_method(&made_anew_method()), true);

}  // namespace
}  // namespace lodlab
