// SPDX-License-Identifier: Apache-2.0
// Style and script of the report.
#pragma once

namespace braid {

inline constexpr const char* kPageHead = R"(<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>braid sweep</title>
<meta name="viewport" content="width=device-width, initial-scale=1">
<style>
body { font: 15px/1.45 system-ui, "DejaVu Sans", sans-serif; color: #222; background: #fff; max-width: 1320px; margin: 1.5em auto; padding: 0 1em }
h1 { font-size: 1.5em } h2 { font-size: 1.25em; margin-top: 2em; border-bottom: 1px solid #ccc } h3 { font-size: 1em; margin: 1.2em 0 .4em }
table { border-collapse: collapse; margin: .6em 0; font-variant-numeric: tabular-nums }
th, td { padding: .2em .7em; text-align: right; border-bottom: 1px solid #e4e4e4; white-space: nowrap }
th:first-child, td:first-child { text-align: left }
th { background: #f5f5f5; font-weight: 600 } table.claims td { text-align: left; white-space: normal } td.best { font-weight: 700; background: #eaf5ea }
dl { display: grid; grid-template-columns: max-content 1fr; gap: .1em 1em; margin: 0 } dt { color: #666 } dd { margin: 0; overflow-wrap: anywhere }
.wide { overflow-x: auto } .row { display: flex; flex-wrap: wrap; gap: .6em; align-items: flex-start }
figure { margin: 0 } figcaption { font-size: .85em; color: #555; text-align: center }
img { image-rendering: auto } .crop img, .map img, .stage img { image-rendering: pixelated }
.plot { width: min(100%, 640px); height: auto } .map img { width: 310px; height: auto }
.scale { display: flex; align-items: center; gap: .5em; margin: .2em 0 .5em; font-size: .85em }
.split { width: min(100%, 640px) } .controls { display: flex; gap: .6em } .controls input { flex: 1 }
.stage { position: relative; margin-top: .3em; overflow: hidden }
.stage img { position: absolute; inset: 0; width: 100%; height: 100% }
.stage i { position: absolute; top: 0; bottom: 0; width: 1px; background: #fff; box-shadow: 0 0 2px #000; pointer-events: none }
</style></head><body>
)";

inline constexpr const char* kPageTail = R"(<script>
for (const split of document.querySelectorAll('.split')) {
  const [left, right] = split.querySelectorAll('select'), range = split.querySelector('input');
  const stage = split.querySelector('.stage'), [under, over] = stage.querySelectorAll('img'), line = stage.querySelector('i');
  stage.style.aspectRatio = split.dataset.w + ' / ' + split.dataset.h;
  const source = name => [...split.querySelectorAll('img[data-name]')].find(i => i.dataset.name === name).src;
  right.selectedIndex = right.options.length - 1;
  const show = () => {
    under.src = source(right.value);
    over.src = source(left.value);
    over.style.clipPath = `inset(0 ${100 - range.value}% 0 0)`;
    line.style.left = range.value + '%';
  };
  const drag = e => {
    if (!e.buttons) return;
    const box = stage.getBoundingClientRect();
    range.value = 100 * (e.clientX - box.left) / box.width;
    show();
  };
  for (const control of [left, right, range]) control.addEventListener('input', show);
  for (const event of ['pointerdown', 'pointermove']) stage.addEventListener(event, drag);
  over.draggable = under.draggable = false;
  show();
}
</script></body></html>
)";

}  // namespace braid
