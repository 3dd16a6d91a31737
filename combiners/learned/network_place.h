// SPDX-License-Identifier: Apache-2.0
// Where the files of braid's own networks lie, by the names of the methods that run them.
#pragma once

#include <string>

namespace braid {

// The name of the environment variable that may say where one is: BRAID_KPN_NETWORK.
std::string networkVariable(const std::string& method);
// The file that nameNetwork() or else that variable says, else the one that lies with the program.
std::string findNetwork(const std::string& method);
// For the rest of the process; an empty name takes it back.
void nameNetwork(const std::string& method, const std::string& file);

// Why the network of the method cannot run here, in one sentence; empty: it can.
std::string networkSkipReason(const std::string& method);

}  // namespace braid
