// Keeps the page as the runs are: it asks for it anew, and puts in place what has changed. Nothing moves for the reader.
"use strict";
const PERIOD = {yes: 2000, no: 10000};  // milliseconds between two looks: while a run goes on, and after
let tag = null, last = null;

const parts = (page) => new Map([...page.querySelectorAll("[data-part]")].map((part) => [part.dataset.part, part]));
const order = (page) => [...parts(page).keys()].join();

// What the reader looks at stays where it is on the screen, whatever grows above it.
function held(change) {
  const seen = [...document.querySelectorAll("h2, [data-part]")].find((e) => e.getBoundingClientRect().bottom > 0);
  const key = seen && (seen.id || seen.dataset.part), before = seen && seen.getBoundingClientRect().top;
  change();
  if (!key || window.scrollY === 0) return;
  const now = document.getElementById(key) || document.querySelector(`[data-part="${key}"]`);
  if (now) window.scrollBy({top: now.getBoundingClientRect().top - before, behavior: "instant"});
}

// A picture that has changed is shown once it is there; the old one stays until then.
function keepPictures(from, to) {
  for (const image of to.querySelectorAll("img[data-picture]")) {
    const old = from.querySelector(`img[data-picture="${image.dataset.picture}"]`);
    if (!old || !old.complete || old.naturalWidth === 0) continue;
    const source = image.getAttribute("src");
    if (old.getAttribute("src") !== source) {
      const next = new Image();
      next.onload = () => {
        const shown = document.querySelector(`img[data-picture="${image.dataset.picture}"]`);
        if (shown) held(() => { shown.setAttribute("src", source); });
      };
      next.src = source;
      old.alt = image.alt;
    }
    image.replaceWith(old);  // the same element: nothing is loaded or drawn again
  }
}

function replacePart(old, fresh) {
  const inner = ".wide, pre", places = [...old.querySelectorAll(inner)].map((e) => [e.scrollLeft, e.scrollTop,
    e.scrollTop + e.clientHeight >= e.scrollHeight - 4]);
  const focused = [...old.querySelectorAll("a, [tabindex]")].indexOf(document.activeElement);
  keepPictures(old, fresh);
  old.replaceChildren(...fresh.childNodes);
  old.querySelectorAll(inner).forEach((e, i) => {
    if (places[i]) [e.scrollLeft, e.scrollTop] = [places[i][0], places[i][2] ? e.scrollHeight : places[i][1]];
  });
  if (focused >= 0) old.querySelectorAll("a, [tabindex]")[focused]?.focus({preventScroll: true});
}

function update(text) {
  const page = new DOMParser().parseFromString(text, "text/html");
  const fresh = new DOMParser().parseFromString(text, "text/html");  // what is taken out of `page` is gone from it
  held(() => {
    if (last === null || order(page) !== order(last)) {
      for (const name of ["header", "main"]) {
        const old = document.querySelector(name), now = page.querySelector(name);
        replacePart(old, now);
      }
    } else {
      const before = parts(last), shown = parts(document);
      for (const [name, part] of parts(page)) {
        if (part.innerHTML !== before.get(name).innerHTML) replacePart(shown.get(name), part);
      }
    }
  });
  document.title = page.title;
  document.documentElement.dataset.goesOn = fresh.documentElement.dataset.goesOn;
  last = fresh;
}

async function look() {
  let answered = true;
  if (!document.hidden) {
    try {
      const answer = await fetch(window.location.pathname + window.location.search,
                                 {cache: "no-cache", signal: AbortSignal.timeout(60000)});
      answered = answer.ok;
      const now = answer.headers.get("ETag");
      if (answer.ok && now !== tag) { update(await answer.text()); tag = now; }
    } catch (error) { answered = false; }
    document.getElementById("lost").hidden = answered;
  }
  window.setTimeout(look, answered ? PERIOD[document.documentElement.dataset.goesOn] : 5000);
}

for (const log of document.querySelectorAll("pre")) log.scrollTop = log.scrollHeight;
document.addEventListener("error", () => {}, true);
look();
