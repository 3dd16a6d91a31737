// SPDX-License-Identifier: Apache-2.0
// A first pass that takes longer than --time allows: dropped for a coarser picture where there is one; where there is
// none it goes on, for an image cannot do without it, and that is said.
#pragma once

#include <atomic>
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
  // `replaced`: there is a picture to take its place, so that it is dropped so long after the limit as that allows an
  // image that is nearly done; otherwise it goes on, and that is said. `writing`: seconds that the file takes.
  LateFirstPass(const TimeLimit& limit, const Session& session, bool quiet, bool replaced, double writing)
      : text_(fmt::format("--time {}: the first pass over the image is not done by then and goes on, for every pixel "
                          "needs a sample; a smaller --size takes less",
                          formatSeconds(limit.seconds()))) {
    if (!limit.exists() || session.state().rounds() > 0) return;
    if (replaced)
      alarm_.emplace(limit.left() + limit.grace() - writing, [this] { dropped_ = true; });
    else
      alarm_.emplace(limit.left(), [this, quiet] {
        late_ = true;
        if (!quiet) fmt::print(stderr, "warning: {}\n", text_);
      });
  }
  // For Session::advance(): the first pass is not waited for.
  const std::atomic<bool>& dropped() const { return dropped_; }
  // So many rounds are done, or the first one was dropped.
  void over(uint64_t rounds, JsonLog& json) {
    if (!alarm_) return;
    alarm_.reset();
    if (rounds > 0) dropped_ = false;  // just in time
    if (late_) json.write("warning", {{"text", text_}});
  }

 private:
  const std::string text_;
  bool late_ = false;
  std::atomic<bool> dropped_{false};
  std::optional<Alarm> alarm_;
};

}  // namespace braid
