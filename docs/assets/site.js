// What axe finds in the theme: a dialog and toolbars without names, scrollable parts that no key reaches, and
// hidden inputs that the keys do reach.
const name = (selector, text) =>
  document.querySelectorAll(selector).forEach((each, at) => each.setAttribute("aria-label", text(at + 1)));

addEventListener("load", () => {
  name(".md-search[role=dialog]", () => "Search");
  name("nav.md-code__nav", (number) => `Code block ${number}`);
  for (const each of document.querySelectorAll("pre > code, .md-typeset__scrollwrap, .katex-display")) {
    each.tabIndex = 0;
  }
  document.querySelectorAll("input.md-option[aria-hidden]").forEach((each) => (each.tabIndex = -1));
});
