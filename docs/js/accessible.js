// Gives the search a name, and makes boxes that scroll accessible by keyboard, because the theme does neither.
window.addEventListener("load", () => {
  document.querySelector(".md-search")?.setAttribute("aria-label", "Search");
  for (const box of document.querySelectorAll(".md-content pre > code, .md-typeset__scrollwrap, .katex-display")) {
    if (box.scrollWidth > box.clientWidth) box.tabIndex = 0;
  }
});
