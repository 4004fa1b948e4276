"""What is told of a run at its end."""

from semidense.pipeline.execution.cluster.running import told_time_line


def task(key: str, worker: str, *spans: tuple[str, float, float]) -> dict[str, object]:
    startstops = [{"action": action, "start": start, "stop": stop} for action, start, stop in spans]
    return {"key": key, "worker": worker, "thread": 1, "startstops": startstops}


def test_the_time_line_adds_up_what_workers_computed() -> None:
    tasks = [
        task("costvolume-make_tile-1f", "tcp://a", ("transfer", 0.0, 1.0), ("compute", 1.0, 4.0)),
        task("costvolume-make_tile-2f", "tcp://b", ("compute", 0.0, 4.0)),
        task("channels-make_whole-3f", "tcp://b", ("compute", 4.0, 5.0)),
    ]
    assert told_time_line(tasks, 10.0) == (
        "cluster: done in 10.0 s; its workers were at work 40 % of that, longest on costvolume 7.0 s, channels 1.0 s"
    )
    assert told_time_line([], 10.0) is None
