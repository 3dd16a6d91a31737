// SPDX-License-Identifier: Apache-2.0
// An image cannot do without its first pass: says so when that takes longer than --time allows.
#pragma once

#include <optional>
#include <string>

#include <fmt/format.h>

#include "renderer/session/session.h"
#include "tools/run/alarm.h"
#include "tools/run/progress_line.h"
#include "tools/run/run_clock.h"

namespace braid {

class LateFirstPass {
 public:
  LateFirstPass(const TimeLimit& limit, const Session& session, bool quiet)
      : text_(fmt::format("--time {}: the first pass over the image is not done by then and goes on, for every pixel "
                          "needs a sample; a smaller --size takes less",
                          formatSeconds(limit.seconds()))) {
    if (!limit.exists() || session.state().rounds() > 0) return;
    alarm_.emplace(limit.left(), [this, quiet] {
      late_ = true;
      if (!quiet) fmt::print(stderr, "warning: {}\n", text_);
    });
  }
  // A pass is done.
  void over(JsonLog& json) {
    if (!alarm_) return;
    alarm_.reset();
    if (late_) json.write("warning", {{"text", text_}});
  }

 private:
  const std::string text_;
  bool late_ = false;
  std::optional<Alarm> alarm_;
};

}  // namespace braid
