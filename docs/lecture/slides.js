const slides = [...document.querySelectorAll("section")];
const present = () => slides.findIndex((one) => one.getBoundingClientRect().bottom > innerHeight / 2);
const steps = { ArrowRight: 1, ArrowDown: 1, PageDown: 1, " ": 1, ArrowLeft: -1, ArrowUp: -1, PageUp: -1 };
addEventListener("keydown", (event) => {
  const step = steps[event.key], to = { Home: 0, End: slides.length - 1 }[event.key] ?? (step && present() + step);
  if (to === undefined) return;
  event.preventDefault();
  slides[Math.min(Math.max(to, 0), slides.length - 1)].scrollIntoView();
});
