// Tables on narrow screens.
"use strict";

// A table of text is stacked there (site.css): each cell is told its heading.
for (const table of document.querySelectorAll("table.text-table")) {
  const headings = [...table.querySelectorAll("thead th")].map(cell => cell.textContent.trim());
  for (const row of table.querySelectorAll("tbody tr"))
    [...row.children].forEach((cell, column) => {
      if (column && headings[column] && cell.textContent.trim()) cell.dataset.heading = headings[column];
    });
}

// A table that is too wide scrolls in a box, which the keyboard can reach.
function heading(box) {
  const caption = box.querySelector("caption");
  if (caption) return caption.textContent.trim();
  const section = box.closest("section");
  const title = section && section.querySelector("h1, h2, h3, h4, h5, h6");
  return title ? [...title.childNodes].filter(n => !n.classList?.contains("headerlink"))
    .map(n => n.textContent).join("").trim() : document.title;
}

function mark(box) {
  const wide = box.scrollWidth > box.clientWidth + 1;
  box.classList.toggle("scrolls", wide);
  box.classList.toggle("at-start", box.scrollLeft < 2);
  box.classList.toggle("at-end", box.scrollLeft + box.clientWidth > box.scrollWidth - 2);
  if (wide) {
    box.tabIndex = 0;
    box.setAttribute("role", "region");
    box.setAttribute("aria-label", `Table, scrolls sideways: ${heading(box)}`);
  } else {
    for (const name of ["tabindex", "role", "aria-label"]) box.removeAttribute(name);
  }
}

const observer = new ResizeObserver(entries => entries.forEach(entry => mark(entry.target)));
for (const box of document.querySelectorAll(".table-wrapper, .cell_output .output.text_html")) {
  box.addEventListener("scroll", () => mark(box), {passive: true});
  observer.observe(box);
}
