// A link to a recorded run becomes the run itself, or the model, where that runs on a page. Builders write addresses
// within a frame in different ways, those of links alike; and without scripts the link remains.
function embed() {
  for (const link of document.querySelectorAll("a.recorded-run")) {
    const frame = document.createElement("iframe");
    const src = link.classList.contains("live-run") ? link.href.replace("/recorded/", "/live/") : link.href;
    Object.assign(frame, { className: link.className, src, title: link.textContent, loading: "lazy" });
    link.replaceWith(frame);
  }
}

if (document.readyState === "loading") document.addEventListener("DOMContentLoaded", embed);
else embed();
