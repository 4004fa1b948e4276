// Left of the line the first configuration, right of it the second, both filtered at R where the filtered map is shown.
const what = show.labels[show.active] ?? show.labels[0]
const column = {"kept at R": "disparity", "raw disparity": "disparity", error: "error", confidence: "confidence"}[what]
const [a, b] = [base, other].map((source) => source.data[column][0])
if (a.length === b.length && a.length > 1) {
  const [sureA, sureB] = [base, other].map((source) => source.data.confidence[0])
  const least = Math.fround(Math.round(100 * slider.value) / 100), filtered = what === "kept at R"
  const width = a.shape[1], edge = Math.round(swipe.value / 100 * width)
  let out = swiped.data[column][0]
  if (out.length !== a.length) out = new a.constructor(a, a.shape)
  for (let i = 0; i < out.length; i++) {
    const left = i % width < edge
    out[i] = filtered && !((left ? sureA[i] : sureB[i]) >= least) ? NaN : (left ? a[i] : b[i])
  }
  swiped.data[column] = [out]
  for (const name of ["disparity", "error", "confidence"]) glyphs[name].visible = name === column
  line.location = edge * step.data.step[0] - 0.5
  swiped.change.emit()
}
