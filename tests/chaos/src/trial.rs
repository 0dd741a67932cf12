//! One trial: starts plant and controller, disturbs one of them, and checks the consequences.

use std::io::Read;
use std::path::PathBuf;
use std::process::{Child, Command};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use crate::arguments::Disturbance;
use crate::place::ChaosFolder;
use crate::tracer::{Traced, Victim};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

/// Time for a traced process to reach its system call.
const REACH: Duration = Duration::from_secs(30);
/// Documented exit codes; 130 after SIGINT and SIGTERM.
const DOCUMENTED: [i32; 6] = [0, 1, 2, 3, 4, 130];
const QUICK: [&str; 4] = ["--set", "run.duration_s=0.05", "--no-plot", "--json"];

/// Exit code of a process whose peer is gone, silent or never came.
pub const NOTICED: i32 = 3;

/// Beginnings of lines that are not errors.
const REMARKS: [&str; 2] = ["the partial record is in ", "line: "];

/// The disturbed process.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ChaosRole {
    Plant,
    Controller,
    /// The parent of both.
    Run,
    /// The emulator that runs the image.
    Emulator,
}

/// Returns the signal that disturbs.
fn signal(disturbance: Disturbance) -> Signal {
    match disturbance {
        Disturbance::Kill => Signal::SIGKILL,
        Disturbance::Stop | Disturbance::Pause => Signal::SIGSTOP,
        Disturbance::Terminate => Signal::SIGTERM,
        Disturbance::Interrupt => Signal::SIGINT,
    }
}

/// Disturbed process, kind of disturbance, and system call.
#[derive(Clone, Copy, Debug)]
pub struct Plan {
    pub victim: ChaosRole,
    pub disturbance: Disturbance,
    pub call: u32,
    /// Whether the victim's peer starts first.
    pub peer_first: bool,
    /// Number of additional plants and controllers on the bus at the same time.
    pub crowd: u32,
}

/// Expected consequences.
pub struct ExpectedOutcome {
    /// [Course](crate::host::ChaosController::course) of an undisturbed run.
    pub course: String,
    /// Time within which everything must have ended after a disturbance.
    pub end: Duration,
}

/// Kind of flaw.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Flaw {
    Hang,
    Orphan,
    Leak,
    UnusableBus,
    Panic,
    ExitCode,
    Message,
}

/// A flaw with details.
pub type Finding = (Flaw, String);

/// Result of a trial.
pub struct TrialOutcome {
    /// Whether the victim reached the system call.
    pub reached: bool,
    /// Time from the disturbance to the end of a peer that noticed it.
    pub noticed: Option<Duration>,
    pub findings: Vec<Finding>,
}

/// Runs one trial on `bus` and compares it with `expected`.
///
/// # Errors
/// An error of the system if a process cannot be started or watched.
pub fn run(
    place: &ChaosFolder,
    bus: &str,
    plan: Plan,
    expected: &ExpectedOutcome,
) -> std::io::Result<TrialOutcome> {
    let end = expected.end;
    let mut findings = Vec::new();
    let record = if plan.call.is_multiple_of(2) {
        "out/run.mcap"
    } else {
        ""
    };
    let mut crowd = Vec::new();
    for _ in 0..plan.crowd {
        for role in [ChaosRole::Plant, ChaosRole::Controller] {
            crowd.push(TrialProcess::start(&mut command(place, role, bus, ""))?);
        }
    }
    let start_peer = || TrialProcess::start(&mut command(place, other(plan.victim), bus, record));
    let mut peer = None;
    if plan.victim != ChaosRole::Run && plan.peer_first {
        peer = Some(start_peer()?);
    }
    let mut victim = Victim::start(&mut command(place, plan.victim, bus, record))?;
    let victim_said = Said::of(&mut victim.child)?;
    if plan.victim != ChaosRole::Run && !plan.peer_first {
        peer = Some(start_peer()?);
    }
    let traced = victim.signal_at(plan.call, signal(plan.disturbance), REACH)?;
    let disturbed = Instant::now();
    let reached = traced == Traced::Injected;
    let mut victim = TrialProcess {
        child: victim.child,
        said: victim_said,
        ended: match traced {
            Traced::Ended(code) => Some(code),
            Traced::Injected => None,
        },
    };

    if reached && plan.disturbance == Disturbance::Pause {
        std::thread::sleep(Duration::from_millis(100));
        continue_process(&victim.child);
    }
    let mut noticed = None;
    if let Some(peer) = &mut peer {
        if peer.wait(disturbed + end)? {
            let took = disturbed.elapsed();
            let (code, text) = peer.outcome();
            // In a crowd the same code means that another process had the bus.
            let is_notice = reached && plan.crowd == 0 && code == Some(NOTICED);
            noticed = is_notice.then_some(took);
            judge("peer", code, &text, &mut findings);
        } else {
            findings.push((Flaw::Hang, "the peer does not end".into()));
        }
    }
    if reached && plan.disturbance == Disturbance::Stop {
        if plan.victim == ChaosRole::Run {
            // The parent is dead, so its children finish on their own.
            std::thread::sleep(Duration::from_millis(200));
        }
        continue_process(&victim.child);
    }
    let limit = Instant::now().max(disturbed) + end;
    if victim.wait(limit)? {
        let (code, text) = victim.outcome();
        // A signal that arrives before its handler is installed ends the process without a message.
        if code.is_some() || !reached {
            judge("victim", code, &text, &mut findings);
        }
    } else {
        findings.push((Flaw::Hang, "the victim does not end".into()));
    }
    for other in &mut crowd {
        if other.wait(Instant::now().max(disturbed) + end)? {
            let (code, text) = other.outcome();
            judge("another", code, &text, &mut findings);
        } else {
            findings.push((Flaw::Hang, "another process on the bus does not end".into()));
        }
    }
    orphans(place, disturbed + end, &mut findings);
    next_run(place, bus, expected, &mut findings)?;
    Ok(TrialOutcome {
        reached,
        noticed,
        findings,
    })
}

/// Returns the peer of a role.
pub fn other(role: ChaosRole) -> ChaosRole {
    match role {
        ChaosRole::Plant => ChaosRole::Controller,
        ChaosRole::Controller | ChaosRole::Run | ChaosRole::Emulator => ChaosRole::Plant,
    }
}

/// Returns the command of a role.
pub fn command(place: &ChaosFolder, role: ChaosRole, bus: &str, record: &str) -> Command {
    let recorded = ["--record", record];
    let unrecorded = ["--no-record"];
    let record = if record.is_empty() {
        &unrecorded[..]
    } else {
        &recorded
    };
    let [silence_s, wait_s] = &place.patience_s;
    let wait = ["--wait-s", wait_s];
    let patience = ["--bus", bus, "--silence-limit-s", silence_s];
    match role {
        ChaosRole::Plant => {
            place.command(&[&["plant"], &patience[..], &wait, &QUICK[..], record].concat())
        }
        ChaosRole::Controller => {
            let controller = place.host.controller();
            place.command(&[&controller[..], &patience[..], &wait].concat())
        }
        ChaosRole::Run | ChaosRole::Emulator => {
            let run = place.host.run();
            place.command(&[&run[..], &patience[..], &QUICK[..], record].concat())
        }
    }
}

/// Checks that processes whose parent has died end, too.
pub fn orphans(place: &ChaosFolder, deadline: Instant, findings: &mut Vec<Finding>) {
    loop {
        let left = place.processes();
        if left.is_empty() {
            return;
        }
        if Instant::now() >= deadline {
            findings.push((Flaw::Orphan, format!("processes {left:?} do not end")));
            for id in left {
                let _ = kill(Pid::from_raw(id), Signal::SIGKILL);
            }
            return;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Checks that the next run on the same bus is undisturbed and leaves nothing.
///
/// # Errors
/// An error of the system if the process cannot be started or watched.
pub fn next_run(
    place: &ChaosFolder,
    bus: &str,
    expected: &ExpectedOutcome,
    findings: &mut Vec<Finding>,
) -> std::io::Result<()> {
    let mut next = TrialProcess::start(&mut command(place, ChaosRole::Run, bus, "out/run.mcap"))?;
    if !next.wait(Instant::now() + expected.end)? {
        findings.push((Flaw::UnusableBus, "the next run does not end".into()));
    }
    let (code, text) = next.outcome();
    let course = place.host.course(&text.stdout);
    if code != Some(0) || course.as_ref() != Some(&expected.course) {
        let errors = text.stderr.trim();
        let text = format!("the next run ended with {code:?} and {course:?}: {errors}");
        findings.push((Flaw::UnusableBus, text));
    }
    let left: Vec<PathBuf> = place.left(bus);
    if !left.is_empty() {
        findings.push((Flaw::Leak, format!("{left:?} stay")));
    }
    Ok(())
}

/// Checks the exit code and the messages of an ended process.
pub fn judge(who: &str, code: Option<i32>, text: &Text, findings: &mut Vec<Finding>) {
    let errors = text.stderr.trim();
    if errors.contains("panicked") {
        findings.push((Flaw::Panic, format!("{who}: {errors}")));
    }
    match code {
        Some(code) if DOCUMENTED.contains(&code) => {}
        other => findings.push((Flaw::ExitCode, format!("{who}: {other:?}, {errors}"))),
    }
    let mut lines: Vec<_> = errors.lines().collect();
    lines.retain(|line| !REMARKS.iter().any(|remark| line.starts_with(remark)));
    let wanted = usize::from(code != Some(0));
    if lines.len() != wanted || lines.iter().any(|line| !line.starts_with("error: ")) {
        findings.push((
            Flaw::Message,
            format!("{who} ended with {code:?}: {errors:?}"),
        ));
    }
}

fn continue_process(child: &Child) {
    if let Ok(id) = i32::try_from(child.id()) {
        // An error means that the process has ended meanwhile.
        let _ = kill(Pid::from_raw(id), Signal::SIGCONT);
    }
}

/// Output of a process.
#[derive(Default)]
pub struct Text {
    pub stdout: String,
    pub stderr: String,
}

/// Reads both pipes of a process while it runs.
struct Said(Receiver<String>, Receiver<String>);

impl Said {
    fn of(child: &mut Child) -> std::io::Result<Self> {
        Ok(Self(read(child.stdout.take())?, read(child.stderr.take())?))
    }

    fn text(&self) -> Text {
        let text = |pipe: &Receiver<String>| {
            pipe.recv_timeout(Duration::from_secs(1))
                .unwrap_or_default()
        };
        Text {
            stdout: text(&self.0),
            stderr: text(&self.1),
        }
    }
}

fn read(pipe: Option<impl Read + Send + 'static>) -> std::io::Result<Receiver<String>> {
    let (sender, receiver) = channel();
    std::thread::Builder::new().spawn(move || {
        let mut text = Vec::new();
        if let Some(mut pipe) = pipe {
            let _ = pipe.read_to_end(&mut text);
        }
        let _ = sender.send(String::from_utf8_lossy(&text).into_owned());
    })?;
    Ok(receiver)
}

/// A process of a trial; killed when dropped.
pub struct TrialProcess {
    child: Child,
    said: Said,
    ended: Option<Option<i32>>,
}

impl TrialProcess {
    /// Starts a command.
    ///
    /// # Errors
    /// An error of the system if the process cannot be started.
    pub fn start(command: &mut Command) -> std::io::Result<Self> {
        let mut child = command.spawn()?;
        Ok(Self {
            said: Said::of(&mut child)?,
            child,
            ended: None,
        })
    }

    /// Waits for the end of the process; after the deadline, kills it and returns `false`.
    ///
    /// # Errors
    /// An error of the system if the process cannot be watched or killed.
    pub fn wait(&mut self, deadline: Instant) -> std::io::Result<bool> {
        while self.ended.is_none() {
            if let Some(status) = self.child.try_wait()? {
                self.ended = Some(status.code());
            } else if Instant::now() >= deadline {
                self.child.kill()?;
                self.ended = Some(self.child.wait()?.code());
                return Ok(false);
            } else {
                std::thread::sleep(Duration::from_millis(2));
            }
        }
        Ok(true)
    }

    /// Returns the exit code (`None` after a signal) and the output.
    pub fn outcome(&self) -> (Option<i32>, Text) {
        (self.ended.flatten(), self.said.text())
    }
}

impl Drop for TrialProcess {
    fn drop(&mut self) {
        if self.ended.is_none() {
            let _ = self.child.kill();
            let _ = self.child.wait();
        }
    }
}
