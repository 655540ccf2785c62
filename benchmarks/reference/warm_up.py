"""Compile the reference for real and complex states, side by side, before many tests want it."""

import multiprocessing

from reference import reference_monodromy, reference_points

import hpcsweep


def main():
    arguments = hpcsweep.Structure(1), 0.01, 0.6, [0.0, 0.0], 1
    calls = reference_points, reference_monodromy
    processes = [multiprocessing.Process(target=call, args=arguments) for call in calls]
    for process in processes:
        process.start()
    for process in processes:
        process.join()


if __name__ == "__main__":
    main()
