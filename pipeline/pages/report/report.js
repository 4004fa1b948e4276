// Zoom and movement: all pictures of a scene show the same place. Without this script they are shown whole.
for (const scene of document.querySelectorAll(".scene")) {
  const slider = scene.querySelector(".zoom input"), told = scene.querySelector(".zoom output");
  const frames = [...scene.querySelectorAll(".frame")];
  const at = (frame) => `${frame.scrollLeft} ${frame.scrollTop}`;
  const put = new Map();  // where a frame was last put from here, so that its own event of that moves nothing

  function place(frame, x, y) {
    frame.scrollTo(x, y);
    put.set(frame, at(frame));
  }

  function follow(frame) {
    if (put.get(frame) === at(frame)) return;
    put.delete(frame);
    for (const other of frames) if (other !== frame) place(other, frame.scrollLeft, frame.scrollTop);
  }

  function zoom(value) {
    const frame = frames[0], before = Number(slider.dataset.now || 1);
    const x = (frame.scrollLeft + frame.clientWidth / 2) / before, y = (frame.scrollTop + frame.clientHeight / 2) / before;
    slider.dataset.now = value;
    scene.style.setProperty("--zoom", value);
    scene.classList.toggle("close", value > 2);
    told.textContent = `${value}x`;
    for (const each of frames) place(each, x * value - each.clientWidth / 2, y * value - each.clientHeight / 2);
  }

  scene.querySelector(".zoom").hidden = false;
  slider.addEventListener("input", () => zoom(Number(slider.value)));
  for (const frame of frames) {
    frame.addEventListener("scroll", () => follow(frame), { passive: true });
    frame.addEventListener("pointerdown", (down) => {
      if (down.pointerType !== "mouse") return;  // a finger scrolls by itself
      const start = [down.clientX + frame.scrollLeft, down.clientY + frame.scrollTop];
      const move = (event) => frame.scrollTo(start[0] - event.clientX, start[1] - event.clientY);
      const stop = () => { removeEventListener("pointermove", move); removeEventListener("pointerup", stop); };
      addEventListener("pointermove", move);
      addEventListener("pointerup", stop);
    });
    frame.addEventListener("keydown", (event) => {
      const step = { "+": 0.5, "=": 0.5, "-": -0.5 }[event.key];
      if (!step) return;
      event.preventDefault();
      slider.value = Number(slider.value) + step;
      zoom(Number(slider.value));
    });
  }
}
