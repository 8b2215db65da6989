// SPDX-License-Identifier: MIT
// The registry: a declaration and a name for each method, in the order in which everything lists them.
#include "method/registry.h"

namespace lodlab {

const Method& full_method();
const Method& chunked_method();
const Method& multigrain_method();
const Method& seamless_method();
const Method& discrete_method();
const Method& subdivision_method();

std::vector<const Method*> built_in_methods() {
  return {&full_method(),     &chunked_method(),  &multigrain_method(),
          &seamless_method(), &discrete_method(), &subdivision_method()};
}

}  // namespace lodlab
