// Renders the equations that pymdownx.arithmatex marks, with the copy of KaTeX in docs/katex.
document.addEventListener("DOMContentLoaded", () => {
  const delimiters = [
    { left: "\\(", right: "\\)", display: false },
    { left: "\\[", right: "\\]", display: true },
  ];
  for (const element of document.querySelectorAll(".arithmatex")) renderMathInElement(element, { delimiters });
});
