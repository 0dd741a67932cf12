//! `cargo xtask chaos`: a program that disturbs plant and controller at every system call.
//!
//! A trial starts plant and controller on a bus and sends one of them a signal at the start of its
//! n-th system call. It then asserts that within 5 s all have ended with a documented exit code and
//! one message, that no process, file or segment remains after the next start, and that the next
//! run on the same bus gives the correct log hash. The controller is a native process, or the image
//! under QEMU, directly or behind a serial line.

mod arguments;
mod emulator;
mod fault;
mod host;
mod place;
mod table;
mod tracer;
mod trial;

use std::io;
use std::process::ExitCode;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use nix::sys::prctl::set_child_subreaper;

use arguments::{ChaosArguments, ChaosHost, Disturbance};
use fault::{FAULTS, InjectedFault};
use host::ChaosController;
use place::{ChaosFolder, unused_segments};
use table::TrialTable;
use trial::{ChaosRole, ExpectedOutcome, Plan, TrialProcess};

/// Time for other processes to remove their present segments.
const OTHERS: Duration = Duration::from_secs(10);

/// Parts of the time in which all must have ended: the longest silence of a peer and the longest
/// wait for one. Of 5 s they are the program's defaults, 1.5 s and 1.7 s.
const PATIENCE: [f64; 2] = [0.3, 0.34];

const WORKER_PANICKED: &str = "a worker has panicked";

fn main() -> ExitCode {
    let arguments =
        ChaosArguments::read(std::env::args_os()).unwrap_or_else(|answer| answer.exit());
    match run(&arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Runs the trials and prints a table of counts.
///
/// # Errors
/// If a process cannot be started or watched, a flaw is found, or no disturbance took effect.
fn run(arguments: &ChaosArguments) -> io::Result<()> {
    // A copy, because the program may be rebuilt during the trials.
    let programs = tempfile::tempdir()?;
    let program = programs.path().join("painleve");
    std::fs::copy(painleve_tests::program(), &program)?;
    // This process adopts orphans, as systemd or a container would.
    set_child_subreaper(true)?;
    painleve_process::interrupt::restore_default_actions()?;
    let runtime = tempfile::tempdir()?;
    let segments_before = unused_segments()?;

    let plans = plans(arguments);
    let patience_s = PATIENCE.map(|part| format!("{:.1}", part * arguments.end_s as f64));
    let next = AtomicUsize::new(0);
    let table = Mutex::new(TrialTable::default());
    let start = Instant::now();
    let is_over = AtomicBool::new(false);
    std::thread::scope(|scope| {
        for _ in 0..arguments.load {
            scope.spawn(|| {
                while !is_over.load(Ordering::Relaxed) {
                    std::hint::spin_loop();
                }
            });
        }
        let workers: Vec<_> = (0..arguments.jobs)
            .map(|worker| {
                let (plans, next, table) = (&plans, &next, &table);
                let (program, runtime) = (&program, runtime.path());
                let host = arguments.host;
                let stop_after_s = arguments.stop_after_s;
                let patience_s = patience_s.clone();
                scope.spawn(move || {
                    let mark = format!("{}-{worker}", std::process::id());
                    let bus = format!("chaos-{worker}");
                    let place = ChaosFolder::new(
                        program,
                        mark,
                        runtime,
                        ChaosController::start(host)?,
                        patience_s,
                    )?;
                    let expected = ExpectedOutcome {
                        course: undisturbed(&place, &bus)?,
                        end: Duration::from_secs(arguments.end_s),
                    };
                    let is_time_left =
                        || stop_after_s.is_none_or(|limit| start.elapsed().as_secs() < limit);
                    while is_time_left()
                        && let Some(&plan) = plans.get(next.fetch_add(1, Ordering::Relaxed))
                    {
                        let outcome = match plan {
                            ChaosTrial::Signal(plan) if plan.victim == ChaosRole::Emulator => {
                                emulator::disturb_emulator(&place, &bus, plan, &expected)?
                            }
                            ChaosTrial::Signal(plan) => trial::run(&place, &bus, plan, &expected)?,
                            ChaosTrial::Fault(victim, fault, number) => {
                                fault::run(&place, &bus, (victim, fault, number), &expected)?
                            }
                        };
                        if let Ok(mut table) = table.lock() {
                            table.add(plan, outcome);
                        }
                    }
                    Ok::<(), io::Error>(())
                })
            })
            .collect();
        let ended = workers.into_iter().map(|worker| {
            worker
                .join()
                .unwrap_or_else(|_| Err(io::Error::other(WORKER_PANICKED)))
        });
        // All of them, or the load would go on.
        let ended: Vec<_> = ended.collect();
        is_over.store(true, Ordering::Relaxed);
        ended.into_iter().collect::<Result<(), _>>()
    })?;

    let mut table = table
        .into_inner()
        .map_err(|_| io::Error::other(WORKER_PANICKED))?;
    let left = || -> io::Result<Vec<String>> {
        Ok(unused_segments()?
            .difference(&segments_before)
            .cloned()
            .collect())
    };
    let ended = Instant::now();
    let mut segments = left()?;
    while !segments.is_empty() && ended.elapsed() < OTHERS {
        std::thread::sleep(Duration::from_millis(100));
        let still = left()?;
        segments.retain(|name| still.contains(name));
    }
    table.print(start.elapsed(), &segments, &patience_s)?;
    let found = table.findings + segments.len();
    if found > 0 {
        return Err(io::Error::other(format!("chaos found {found} flaws")));
    }
    if table.injections() == 0 {
        return Err(io::Error::other("no disturbance took effect"));
    }
    Ok(())
}

/// Returns the course of an undisturbed run.
fn undisturbed(place: &ChaosFolder, bus: &str) -> io::Result<String> {
    let mut run = TrialProcess::start(&mut trial::command(place, ChaosRole::Run, bus, ""))?;
    run.wait(Instant::now() + Duration::from_secs(20))?;
    let (_, text) = run.outcome();
    place
        .host
        .course(&text.stdout)
        .ok_or_else(|| io::Error::other(format!("the undisturbed run failed: {}", text.stderr)))
}

/// One trial.
#[derive(Clone, Copy, Debug)]
enum ChaosTrial {
    Signal(Plan),
    Fault(ChaosRole, InjectedFault, u32),
}

impl ChaosTrial {
    /// Returns the name of its line in the table.
    fn kind(&self) -> String {
        match self {
            Self::Signal(plan) => format!("{:?} {:?}", plan.victim, plan.disturbance),
            Self::Fault(victim, fault, _) => {
                format!("{victim:?} {} {}", fault.error, fault.call)
            }
        }
        .to_lowercase()
    }
}

/// Returns every system call of every role with every disturbance, or a random selection of them.
fn plans(arguments: &ChaosArguments) -> Vec<ChaosTrial> {
    let mut plans = Vec::new();
    for call in arguments.first..=arguments.last {
        for victim in [ChaosRole::Plant, ChaosRole::Controller, ChaosRole::Run] {
            for &disturbance in &arguments.disturbances {
                let peer_first = (call + disturbance as u32).is_multiple_of(2);
                plans.push(ChaosTrial::Signal(Plan {
                    victim,
                    disturbance,
                    call,
                    peer_first,
                    crowd: arguments.crowd,
                }));
            }
        }
        if arguments.host == ChaosHost::Qemu {
            plans.extend([Disturbance::Kill, Disturbance::Stop].map(|disturbance| {
                ChaosTrial::Signal(Plan {
                    victim: ChaosRole::Emulator,
                    disturbance,
                    call,
                    peer_first: false,
                    crowd: 0,
                })
            }));
        }
    }
    if arguments.faults > 0 {
        plans.clear();
    }
    for fault in FAULTS {
        for victim in [ChaosRole::Plant, ChaosRole::Controller] {
            plans.extend((1..=arguments.faults).map(|n| ChaosTrial::Fault(victim, fault, n)));
        }
    }
    // Shuffled, so that long waits spread over the workers and a selection is representative.
    let mut random = SplitMix(arguments.seed);
    for last in (1..plans.len()).rev() {
        let other = (random.next() % (last as u64 + 1)) as usize;
        plans.swap(last, other);
    }
    plans.truncate(arguments.trials.unwrap_or(plans.len()));
    plans
}

/// SplitMix64 (Steele, Lea and Flood), sufficient for shuffling.
struct SplitMix(u64);

impl SplitMix {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
}
