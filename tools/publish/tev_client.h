// SPDX-License-Identifier: Apache-2.0
// Shows images in tev while they are rendered. A thread of its own talks to the viewer: whoever has images hands them
// over and goes on, whether the viewer listens, hangs, goes away or was never there.
#pragma once

#include <memory>
#include <string>
#include <thread>

#include "tools/publish/image_output.h"
#include "tools/publish/tev_packets.h"

namespace braid {

struct TevAddress {
  std::string host, port = "14158";
};
// HOST:PORT, or HOST for tev's own port. Throws Error(Usage).
TevAddress parseTevAddress(const std::string& text);

class TevClient {
 public:
  explicit TevClient(const TevAddress& address);
  // The newest images still go out if the viewer takes them within kGrace seconds.
  ~TevClient();
  TevClient(const TevClient&) = delete;
  TevClient& operator=(const TevClient&) = delete;

  static constexpr double kGrace = 2;

  // Hands over the newest state of an image. Of each name one waits at most: it takes the place of an older one that
  // could not be sent yet.
  void show(const std::string& name, TevImage image);

  // One line, once, after the viewer could not be reached or went away; else empty.
  std::string takeWarning();

 private:
  struct Mailbox;
  class Sender;
  std::shared_ptr<Mailbox> mailbox_;  // also the thread's, which may outlive this while the system looks up a host
  std::thread thread_;
};

// The images "TITLE: noisy" and "TITLE: combined", as far as there are such, each with its estimated squared error as
// the layer Error.
void showInTev(TevClient& tev, const std::string& title, const ImageViews& views);

}  // namespace braid
