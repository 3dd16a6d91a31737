// SPDX-License-Identifier: Apache-2.0
// As where no network can be run: what a test then holds is the same on every machine.
#pragma once

#include "combiners/denoise/kpn/kpn_network.h"

namespace braid::test {

struct WithoutKpn {
  WithoutKpn() { nameKpnNetwork("/nowhere/kpn.network"); }
  ~WithoutKpn() { nameKpnNetwork(""); }
};

}  // namespace braid::test
