"""A campaign whose pieces are tasks of Dask, on two local workers or on a cluster.

    pip install 'dask[distributed]'
    python3 dask_campaign.py CAMPAIGN.ron PLAN [SCHEDULER]

All workers need brakecheck and the directory PLAN. With Ray, the two middle lines are
`make = ray.remote(brakecheck.run_piece)` and `ray.get([make.remote(plan, piece, jobs=1) for
piece in phase])`.
"""

import sys

import brakecheck
from dask.distributed import Client


def main(campaign: str, plan: str, *scheduler: str) -> None:
    about = brakecheck.plan(campaign, plan).about
    client = Client(*scheduler) if scheduler else Client(n_workers=2, threads_per_worker=1)
    with client:
        # Trainings have the lowest numbers, and the other pieces need them.
        for phase in (range(about["trainings"]), range(about["trainings"], about["pieces"])):
            made = client.map(brakecheck.run_piece, [plan] * len(phase), phase, jobs=1, pure=False)
            client.gather(made)
    merged = brakecheck.merge(plan)
    print(merged.to_pandas()[["world", "ego", "ado", "starts"]].to_string())
    print("SHA-256", merged.about["sha256"])


if __name__ == "__main__":
    main(*sys.argv[1:])
