// SPDX-License-Identifier: Apache-2.0
// What a pass reads of its integrator's preparation.
#pragma once

#include <memory>
#include <type_traits>

#include "renderer/session/integrator.h"

namespace braid {

// The preparation of a request, or one of its own when it has none.
template <class T>
class PreparationRef {
 public:
  explicit PreparationRef(const PassRequest& request) : used_(dynamic_cast<const T*>(request.preparation)) {
    if (used_) return;
    if constexpr (std::is_constructible_v<T, const TransportContext&, const Plan&>)
      own_ = std::make_unique<T>(request.context, request.plan);
    else
      own_ = std::make_unique<T>(request.context);
    used_ = own_.get();
  }
  const T* operator->() const { return used_; }

 private:
  std::unique_ptr<const T> own_;
  const T* used_;
};

}  // namespace braid
