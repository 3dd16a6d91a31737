# SPDX-License-Identifier: Apache-2.0
# Makes the page a part of the program: PAGE (HTML) to HEADER, which defines kPreviewPage.
file(READ ${PAGE} text)
# Pieces, because compilers need not take longer string literals.
string(LENGTH "${text}" length)
set(literals "")
set(begin 0)
while(begin LESS length)
  string(SUBSTRING "${text}" ${begin} 8000 piece)
  string(APPEND literals "\n    R\"page~(${piece})page~\"")
  math(EXPR begin "${begin} + 8000")
endwhile()
file(WRITE ${HEADER} "// Made of tools/preview/page.html.\n#pragma once\n\nnamespace braid {\n\ninline constexpr char kPreviewPage[] =${literals};\n\n}  // namespace braid\n")
