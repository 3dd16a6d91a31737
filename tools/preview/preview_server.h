// SPDX-License-Identifier: Apache-2.0
// Serves a preview to browsers of this machine, and to nobody else: it listens on 127.0.0.1 and answers only requests
// that name this machine, so that pages from elsewhere can neither read it nor stop the render.
//
//   GET /                  the page
//   GET /state.json        what PreviewBoard::state() says; ?after=VERSION waits until there is something newer
//   GET /image?view=NAME   pixels as PreviewImage holds them, described by the headers X-Braid-Width, -Height,
//                          -Channels, -Exponent, -Auto-Exposure, -Spp, -Version
//   POST /stop             ends the render as if its samples were done
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "tools/preview/preview_board.h"

namespace braid {

class PreviewServer {
 public:
  // Port 0: any that is free. `stop` is called from the server's threads. Throws Error(OutputFailed) when the port
  // cannot be had.
  PreviewServer(PreviewBoard& board, int port, std::function<void()> stop);
  ~PreviewServer();
  PreviewServer(const PreviewServer&) = delete;
  PreviewServer& operator=(const PreviewServer&) = delete;

  const std::string& url() const;
  // Whether somebody asked for the state within the last so many seconds, or is waiting for an answer.
  bool watched(double seconds) const;

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace braid
