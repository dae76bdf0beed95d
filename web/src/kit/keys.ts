// Walking over items with keys, and words for screen readers.

/** Arrow keys, Home and End go from the item with the focus to another one. */
export function walk(event: KeyboardEvent, items: readonly HTMLElement[]): void {
  const at = items.indexOf(document.activeElement as HTMLElement);
  const to = at < 0 ? undefined : target(event.key, at, items);
  if (to === undefined) return;
  event.preventDefault();
  items[to]!.focus();
}

function target(key: string, at: number, items: readonly HTMLElement[]): number | undefined {
  if (key === "Home") return 0;
  if (key === "End") return items.length - 1;
  if (key === "ArrowRight") return Math.min(at + 1, items.length - 1);
  if (key === "ArrowLeft") return Math.max(at - 1, 0);
  if (key === "ArrowDown" || key === "ArrowUp") return nextRow(at, items, key === "ArrowDown" ? 1 : -1);
  return undefined;
}

// The item in the next row whose middle is nearest.
function nextRow(at: number, items: readonly HTMLElement[], way: number): number {
  const from = items[at]!.getBoundingClientRect();
  let best = at;
  let least = Infinity;
  items.forEach((item, i) => {
    const box = item.getBoundingClientRect();
    const rows = (box.top - from.top) * way;
    if (rows < 1) return;
    const far = rows * 1000 + Math.abs(box.left - from.left);
    if (far < least) [least, best] = [far, i];
  });
  return best;
}

/** Read aloud once. */
export function announce(words: string): void {
  document.getElementById("announcements")!.textContent = words;
}

/** Announces a change of state ("" is the normal state). The words may change each second; they are read once. */
export function announcer(): (state: string, words: string) => void {
  let told = "";
  return (state, words) => {
    if (state === told) return;
    told = state;
    announce(words);
  };
}
