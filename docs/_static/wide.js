// Tables and pictures on narrow screens.
"use strict";

// A table of text is stacked there (site.css): each cell is told its heading.
for (const table of document.querySelectorAll("table.text-table")) {
  const headings = [...table.querySelectorAll("thead th")].map(cell => cell.textContent.trim());
  for (const row of table.querySelectorAll("tbody tr"))
    [...row.children].forEach((cell, column) => {
      if (column && headings[column] && cell.textContent.trim()) cell.dataset.heading = headings[column];
    });
}

// What is too wide scrolls in a box, which the keyboard can reach.
function name(box) {
  const picture = box.querySelector(":scope > img");
  if (picture) return picture.alt;
  const caption = box.querySelector("caption");
  if (caption) return caption.textContent.trim();
  const section = box.closest("section");
  const title = section && section.querySelector("h1, h2, h3, h4, h5, h6");
  return title ? [...title.childNodes].filter(n => !n.classList?.contains("headerlink"))
    .map(n => n.textContent).join("").trim() : document.title;
}

function markEnds(box) {
  box.classList.toggle("at-start", box.scrollLeft < 2);
  box.classList.toggle("at-end", box.scrollLeft + box.clientWidth > box.scrollWidth - 2);
}

function mark(box) {
  // Measured without the class, whose style makes a table narrower: it would come and go.
  const left = box.scrollLeft;
  box.classList.remove("scrolls");
  const wide = box.scrollWidth > box.clientWidth + 1;
  box.classList.toggle("scrolls", wide);
  box.scrollLeft = left;
  markEnds(box);
  if (wide) {
    box.tabIndex = 0;
    box.setAttribute("role", "region");
    const kind = box.classList.contains("picture-box") ? "Figure" : "Table";
    box.setAttribute("aria-label", `${kind}, scrolls sideways: ${name(box)}`);
  } else {
    for (const attribute of ["tabindex", "role", "aria-label"]) box.removeAttribute(attribute);
  }
}

// What is in a box may grow while the box does not, for instance when a font has arrived.
const boxes = new Map();
const observer = new ResizeObserver(entries => entries.forEach(entry => mark(boxes.get(entry.target))));
function watch(box) {
  box.addEventListener("scroll", () => markEnds(box), {passive: true});
  for (const element of [box, box.querySelector("table, img")]) {
    boxes.set(element, box);
    observer.observe(element);
  }
}

for (const box of document.querySelectorAll(".table-wrapper, .cell_output .output.text_html"))
  if (box.querySelector("table")) watch(box);

// A picture of several panels side by side would be too small on a phone.
function enlarge(picture) {
  if (picture.naturalWidth < 1.63 * picture.naturalHeight) return;
  const box = document.createElement("div");
  box.className = "picture-box";
  picture.replaceWith(box);
  box.append(picture);
  watch(box);
}

for (const picture of document.querySelectorAll(".cell_output img"))
  if (picture.complete) enlarge(picture);
  else picture.addEventListener("load", () => enlarge(picture), {once: true});
