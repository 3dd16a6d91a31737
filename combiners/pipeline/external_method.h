// SPDX-License-Identifier: Apache-2.0
// Methods that depend on something besides the estimates: a file, a library that may be absent.
#pragma once

#include <memory>
#include <string>

#include "combiners/method.h"

namespace braid {

class ExternalMethod : public Method {
 public:
  // Why it cannot run here, in one sentence without the method's name; empty: it can.
  virtual std::string skipReason() const { return {}; }
  // The method for what follows the colon in "name:parameter"; null: it takes no parameter. Throws Error(BadInput).
  virtual std::unique_ptr<Method> with(const std::string& /*parameter*/) const { return nullptr; }
};

}  // namespace braid
