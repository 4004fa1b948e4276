import numba

from semidense.stages.compute.compiling import Compiling


def test_the_first_compilation_is_told_once_and_nothing_after_the_stop() -> None:
    told: list[str] = []
    listener = Compiling(lambda: told.append("compiling"))
    doubled = numba.njit(lambda x: 2 * x)
    assert told == [], "nothing is compiled before the first call"
    assert doubled(3) == 6
    assert doubled(2.5) == 5.0
    assert told == ["compiling"], "two types, told once"
    listener.stop()
    other = Compiling(lambda: told.append("again"))
    assert doubled(4) == 8
    assert told == ["compiling"], "it was compiled for whole numbers before"
    other.stop()
    assert numba.njit(lambda x: 3 * x)(3) == 9
    assert told == ["compiling"]
