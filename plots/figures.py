"""The figures of the report, in its order. A new figure is one file and one entry here."""
import anatomy_map
import anatomy_roofline
import anatomy_time
import cas_failures
import contention_map
import efficiency
import latency
import lock_wait
import machine_differences
import machine_throughput
import pareto
import preemption
import promises
import redundant_records
import repeatability
import run_differences
import scaling_law
import simulated
import speed_error
import speedup
import steps
import structure_mechanism
import thesis_equal_error
import thesis_frame_times
import thesis_mechanisms
import thesis_vpls
import throughput
import time_breakdown
import timeline
import utilisation
import witness

# Of what was measured.
FIGURES = [module.FIGURE for module in (throughput, speedup, efficiency, scaling_law, contention_map,
                                        structure_mechanism, speed_error, latency, time_breakdown,
                                        lock_wait, utilisation, redundant_records, cas_failures)]
# Of what icbench pareto measured.
PARETO_FIGURES = [pareto.FIGURE]
# Of what icbench repeatability measured.
REPEATABILITY_FIGURES = [repeatability.FIGURE]
# Of what bench's anatomy measured.
ANATOMY_FIGURES = [anatomy_time.FIGURE, anatomy_map.FIGURE, anatomy_roofline.FIGURE]
# Of two runs.
COMPARISON_FIGURES = [run_differences.FIGURE]
# Of one change, and of one version, on several machines.
CHANGE_FIGURES = [machine_differences.FIGURE]
VERSION_FIGURES = [machine_throughput.FIGURE]
# Of what icbench preempt measured.
PREEMPTION_FIGURES = [preemption.FIGURE]
# Of what icbench simulate made: nothing that was measured.
SIMULATED_FIGURES = [simulated.FIGURE]
# Of a sweep that accounted for its time, apart from what is measured otherwise.
BREAKDOWN_FIGURES = [time_breakdown.FIGURE]
# Of one trial each.
TIMELINE_FIGURES = [timeline.FIGURE]
# Of what was checked.
CORRECTNESS_FIGURES = [module.FIGURE for module in (promises, witness, steps)]
# Of what bench/tables measured.
THESIS_FIGURES = [module.FIGURE for module in (thesis_vpls, thesis_frame_times, thesis_equal_error, thesis_mechanisms)]
