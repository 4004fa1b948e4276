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

const at = table.data.R.findIndex((each) => Math.abs(each - R) < 1e-9)
const known = at >= 0
point.data.invalid = known ? [table.data.invalid[at]] : []
point.data.bad = known ? [table.data.bad[at]] : []
point.data.side = known ? [table.data.invalid[at] > 50 ? "right" : "left"] : []
point.data.label = known ? [`R = ${R}`] : []
point.change.emit()
const number = (name, digits) => Number.isFinite(table.data[name][at]) ? table.data[name][at].toFixed(digits) : "none"
const fact = (name, value, id = "") => `<span class="fact">${name} <b id="${id}">${value}</b></span> `
const share = () => (100 * shown.filter((d) => Number.isFinite(d)).length / shown.length).toFixed(1)
told.text = fact("R", R.toFixed(2)) + (known
  ? fact("error of kept", `${number("bad", 2)} %`, "bad") + fact("not kept", `${number("invalid", 2)} %`, "invalid")
    + fact("mean error", `${number("avgerr", 3)} px`, "avgerr") + fact("rms", `${number("rms", 3)} px`, "rms")
  : fact("kept", `${share()} %`) + "no ground truth is cached")
