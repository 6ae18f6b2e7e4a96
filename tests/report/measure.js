() => {
const BOXES = "h1,h2,h3,p,li,dt,dd,th,td,caption,figcaption,summary,.number,.big div,.scroll";
const split = /[^\s\-\/\u2013]+[\-\/\u2013]?/g;
function broken(doc) {
  const walker = doc.createTreeWalker(doc.body, NodeFilter.SHOW_TEXT), found = [];
  for (let node; (node = walker.nextNode()); ) {
    const parent = node.parentElement;
    if (parent.closest(".long, style, svg") || !parent.checkVisibility()) continue;
    for (const word of node.data.matchAll(split)) {
      const range = doc.createRange();
      range.setStart(node, word.index);
      range.setEnd(node, word.index + word[0].length);
      const lines = new Set([...range.getClientRects()].filter(r => r.width > 0.5).map(r => Math.round(r.top)));
      if (lines.size > 1) found.push(word[0]);
    }
  }
  return found;
}
function out(doc) {
  const found = [];
  for (const e of doc.querySelectorAll(BOXES)) {
    if (e.closest(".axis, .residuals td") || !e.checkVisibility()) continue;
    if (e.matches(".scroll") ? e.closest("details") : e.closest("details .scroll")) continue;
    if (e.scrollWidth > e.clientWidth + 1 && getComputedStyle(e).display != "inline")
      found.push(e.tagName + ": " + e.textContent.trim().slice(0, 40));
  }
  for (const svg of doc.querySelectorAll("svg.plot")) {
    const box = svg.getBoundingClientRect();
    if (!box.width) continue;
    const texts = [...svg.querySelectorAll("text")].filter(t => !t.closest(".readout"));
    const boxes = texts.map(t => t.getBoundingClientRect());
    boxes.forEach((b, i) => {
      if (b.left < box.left - 1 || b.right > box.right + 1 || b.top < box.top - 1 || b.bottom > box.bottom + 1)
        found.push(svg.id + ": " + texts[i].textContent);
      boxes.slice(0, i).forEach((o, j) => {
        const across = Math.min(b.right, o.right) - Math.max(b.left, o.left);
        const down = Math.min(b.bottom, o.bottom) - Math.max(b.top, o.top);
        if (across > 1 && down > 3) found.push(svg.id + ": " + texts[j].textContent + " | " + texts[i].textContent);
      });
    });
  }
  return found;
}
return [...document.querySelectorAll("iframe")].map(f => {
  const doc = f.contentDocument, root = doc.documentElement;
  return [f.title, root.clientWidth, root.scrollWidth, root.scrollHeight, broken(doc), out(doc),
    doc.querySelector(".pair")?.getBoundingClientRect().bottom];
});
}
