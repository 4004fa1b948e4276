// The charts are drawn on canvases, which no style sheet reaches: give them the page's colours, also when these change.
const dark = matchMedia("(prefers-color-scheme: dark)")
const paint = () => {
  const style = getComputedStyle(document.documentElement)
  const [ink, line] = ["--ink", "--line"].map((name) => style.getPropertyValue(name).trim())
  const text = {axis_label_text_color: ink, major_label_text_color: ink, axis_line_color: ink}
  for (const chart of charts) {
    for (const axis of [...chart.below, ...chart.left])
      axis.setv({...text, major_tick_line_color: ink, minor_tick_line_color: line})
    for (const grid of chart.center) if (grid.properties.grid_line_color) grid.grid_line_color = line
    for (const {glyph} of chart.renderers) if (glyph?.type === "Text") glyph.text_color = {value: ink}
  }
}
dark.addEventListener("change", paint)
paint()
