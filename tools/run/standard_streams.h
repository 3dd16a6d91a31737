// SPDX-License-Identifier: Apache-2.0
// What happens to standard output, standard error and the signals that come with broken ones: messages that nobody
// reads end nothing, results that cannot be written end in exit code 3.
#pragma once

namespace braid {

// First of all in main(). Descriptors 0 to 2 that are closed are taken, so that no file of a render gets their numbers.
// Messages to standard error that cannot be written are lost without ado. SIGPIPE and SIGXFSZ do not kill, but make
// writing fail; programs that are started get them as ever.
void prepareStandardStreams();

// Last of all: the exit code of a command that has ended with `code`, 3 if what it printed could not be written.
int exitCodeAfterPrinting(int code);

}  // namespace braid
