// Filter at R: what keep_confident does, in the browser. Changes are not sent back: the server has them all.
const R = Math.round(100 * slider.value) / 100, least = Math.fround(R)
const [disparity, confidence, error] = ["disparity", "confidence", "error"].map((name) => base.data[name][0])
const fresh = (like) => new like.constructor(like, like.shape)
let shown = kept.data.disparity[0], wrong = kept.data.error[0]
if (shown.length !== disparity.length) { shown = fresh(disparity); wrong = fresh(error) }
for (let i = 0; i < shown.length; i++) {
  const keep = confidence[i] >= least
  shown[i] = keep ? disparity[i] : NaN
  wrong[i] = keep || error[i] < 0 ? error[i] : NaN
}
kept.data.disparity = [shown]
kept.data.error = [wrong]
kept.change.emit()

// The figures at R, of the second configuration too if there is one.
const place = ({data}) => data.R.findIndex((each) => Math.abs(each - R) < 1e-9)
const found = [[table, place(table), "#D55E00", ""], [second, place(second), "#E69F00", "second-"]].filter((each) => each[1] >= 0)
point.data.invalid = found.map(([{data}, at]) => data.invalid[at])
point.data.bad = found.map(([{data}, at]) => data.bad[at])
point.data.side = found.map(([{data}, at]) => data.invalid[at] > 50 ? "right" : "left")
point.data.label = found.map((_, n) => n ? "" : `R = ${R}`)
point.data.colour = found.map((each) => each[2])
point.change.emit()
const fact = (name, value, id = "") => `<span class="fact">${name} <b id="${id}">${value}</b></span> `
const figures = ([{data}, at, colour, id]) => [["bad", 2, "%"], ["invalid", 2, "%"], ["avgerr", 3, "px"], ["rms", 3, "px"]]
  .map(([name, digits, unit]) => fact(name, Number.isFinite(data[name][at]) ? `${data[name][at].toFixed(digits)} ${unit}` : "none", id + name)).join("")
const which = (n) => found.length > 1 ? `<span class="which">${names.data.name[n]}</span>` : ""
const share = () => (100 * shown.filter((d) => Number.isFinite(d)).length / shown.length).toFixed(1)
told.text = fact("R", R.toFixed(2)) + (found.length
  ? found.map((each, n) => which(n) + figures(each)).join("")
  : fact("kept", `${share()} % of all pixels`) + "not judged by a ground truth yet")
