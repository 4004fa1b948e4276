"""The smallest run of the whole path: three scenes of 64 x 80 px, 9 disparities, two steps of training a network."""

from semidense.stages.catalog import STAGES


def _above(product: str) -> set[str]:
    stage = STAGES.get(product)
    needed = getattr(stage.params(), "inputs", stage.inputs) if stage else ()
    return {product}.union(*(_above(each) for each in needed))


PATH = _above("metrics")
"""The products of a whole run; others are made on demand."""
NETS = ("matching_net", "evaluation_net")
"""Its networks."""
SPEC = "synthetic:train=2,test=1,height=64,width=80,disparities=8"
SETTINGS = (
    "matching_samples.samples=8",
    "matching_samples.height=8",
    "matching_samples.width=16",
    "matching_net.steps=2",
    "matching_net.batch=2",
    "descriptor_net.steps=2",
    "descriptor_net.batch=2",
    "evaluation_samples.samples=8",
    "evaluation_samples.rows=2",
    "evaluation_samples.columns=2",
    "evaluation_net.steps=2",
    "evaluation_net.batch=2",
)
TEST_ONLY = "synthetic:train=0,test=1,height=64,width=80,disparities=8"
"""The same test scene for runs with weights that are there already."""


def options(*more: str) -> list[str]:
    """The settings as arguments of a command."""
    return [argument for setting in (*SETTINGS, *more) for argument in ("--set", setting)]


TRAINED = [SPEC, "--train", *options()]
"""The arguments of the run that the session's cache holds."""
