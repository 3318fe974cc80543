// Gives names and keyboard access to parts that the theme leaves without: the search, and boxes that scroll.
window.addEventListener("load", () => {
  document.querySelector(".md-search")?.setAttribute("aria-label", "Search");
  for (const box of document.querySelectorAll(".md-content pre > code, .md-typeset__scrollwrap, .katex-display")) {
    if (box.scrollWidth > box.clientWidth) box.tabIndex = 0;
  }
});
