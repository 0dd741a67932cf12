//! Both ends of a bus compared with a model, under random sequences of actions.

use std::collections::VecDeque;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;

use proptest::prelude::*;
use proptest_state_machine::{ReferenceStateMachine, StateMachineTest, prop_state_machine};

use super::*;

/// Actions of the two ends.
#[derive(Clone, Copy, Debug)]
enum Step {
    StartPlant,
    StartSecondPlant,
    /// A controller starts while the plant waits for one.
    Join,
    StartSecondController,
    /// The plant sends this number of frames.
    Send(u32),
    /// The controller receives.
    Receive,
    /// The controller sends this number of answers.
    Answer(u32),
    /// The plant polls for an answer.
    TakeAnswer,
    /// One lockstep tick.
    Exchange,
    EndPlant,
    DropPlant,
    DropController,
}

/// How a plant has left.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Left {
    WithEnd,
    WithoutEnd,
}

/// A controller, and the messages in transit to it.
#[derive(Clone, Debug, Default)]
struct Joined {
    frames: VecDeque<u32>,
    plant_left: Option<Left>,
}

#[derive(Clone, Debug, Default)]
struct BusModel {
    has_plant: bool,
    controller: Option<Joined>,
    /// Answers in transit to the plant.
    answers: VecDeque<u32>,
    /// Number of the next frame and of the next answer.
    next: u32,
    /// Expected outcome of the last step.
    expected: Outcome,
}

/// Outcome of a step.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
enum Outcome {
    #[default]
    Done,
    Refused,
    Frame(u32),
    End,
    PlantGone,
    Answer(u32),
    NoAnswer,
    /// Either no answer, or an error that the controller is gone: the plant checks only
    /// occasionally.
    NoAnswerOrGone,
}

/// Appends to a queue that drops its oldest entry when it is full.
fn push(queue: &mut VecDeque<u32>, tick: u32) {
    queue.push_back(tick);
    if queue.len() > FRAME_BUFFER {
        queue.pop_front();
    }
}

impl BusModel {
    fn is_joined(&self) -> bool {
        self.has_plant && self.controller.is_some()
    }

    fn allows(&self, step: &Step) -> bool {
        match step {
            Step::StartPlant => !self.has_plant && self.controller.is_none(),
            Step::StartSecondPlant | Step::Send(_) | Step::TakeAnswer => self.has_plant,
            Step::EndPlant | Step::DropPlant => self.has_plant,
            Step::Join => self.has_plant && self.controller.is_none(),
            Step::StartSecondController => self.is_joined(),
            // Otherwise it would block.
            Step::Receive => (self.controller.as_ref())
                .is_some_and(|joined| !joined.frames.is_empty() || joined.plant_left.is_some()),
            Step::Answer(_) => self.is_joined(),
            Step::Exchange => {
                let is_idle = |joined: &Joined| joined.frames.is_empty();
                self.has_plant
                    && self.answers.is_empty()
                    && self.controller.as_ref().is_some_and(is_idle)
            }
            Step::DropController => self.controller.is_some(),
        }
    }

    fn numbers(&mut self, count: u32) -> std::ops::Range<u32> {
        let first = self.next;
        self.next += count;
        first..self.next
    }

    fn leave(&mut self, how: Left) {
        self.has_plant = false;
        self.answers.clear();
        if let Some(joined) = &mut self.controller {
            joined.plant_left = Some(how);
        }
    }

    fn step(&mut self, step: &Step) -> Outcome {
        match step {
            Step::StartPlant => self.has_plant = true,
            Step::StartSecondPlant | Step::StartSecondController => return Outcome::Refused,
            Step::Join => {
                self.controller = Some(Joined::default());
                self.answers.clear();
            }
            Step::Send(count) => {
                for tick in self.numbers(*count) {
                    if let Some(joined) = &mut self.controller {
                        push(&mut joined.frames, tick);
                    }
                }
            }
            Step::Receive => {
                if let Some(joined) = &mut self.controller {
                    return match (joined.frames.pop_front(), joined.plant_left) {
                        (Some(tick), _) => Outcome::Frame(tick),
                        (None, Some(Left::WithEnd)) => Outcome::End,
                        (None, _) => Outcome::PlantGone,
                    };
                }
            }
            Step::Answer(count) => {
                for tick in self.numbers(*count) {
                    push(&mut self.answers, tick);
                }
            }
            Step::TakeAnswer => {
                return match self.answers.pop_front() {
                    Some(tick) => Outcome::Answer(tick),
                    None if self.controller.is_some() => Outcome::NoAnswer,
                    None => Outcome::NoAnswerOrGone,
                };
            }
            Step::Exchange => return Outcome::Answer(self.numbers(1).start),
            Step::EndPlant => self.leave(Left::WithEnd),
            Step::DropPlant => self.leave(Left::WithoutEnd),
            Step::DropController => self.controller = None,
        }
        Outcome::Done
    }
}

struct BusReference;

impl ReferenceStateMachine for BusReference {
    type State = BusModel;
    type Transition = Step;

    fn init_state() -> BoxedStrategy<BusModel> {
        Just(BusModel::default()).boxed()
    }

    fn transitions(model: &BusModel) -> BoxedStrategy<Step> {
        let many = 2 * FRAME_BUFFER as u32;
        let steps = [
            Step::StartPlant,
            Step::StartSecondPlant,
            Step::Join,
            Step::StartSecondController,
            Step::Send(1),
            Step::Receive,
            Step::Answer(1),
            Step::TakeAnswer,
            Step::Exchange,
            Step::EndPlant,
            Step::DropPlant,
            Step::DropController,
        ];
        let allowed: Vec<Step> = steps
            .into_iter()
            .filter(|step| model.allows(step))
            .collect();
        (prop::sample::select(allowed), 1..6_u32, 0..many)
            .prop_map(|(step, few, many)| {
                // An occasional burst.
                let count = if few == 1 { many } else { few };
                match step {
                    Step::Send(_) => Step::Send(count),
                    Step::Answer(_) => Step::Answer(count),
                    other => other,
                }
            })
            .boxed()
    }

    fn preconditions(model: &BusModel, step: &Step) -> bool {
        model.allows(step)
    }

    fn apply(mut model: BusModel, step: &Step) -> BusModel {
        model.expected = model.step(step);
        model
    }
}

/// The controller's end stays in the thread that created it.
struct ControllerThread {
    orders: Sender<Order>,
    outcomes: Receiver<Outcome>,
    thread: Option<JoinHandle<()>>,
}

enum Order {
    Receive,
    Answer(u32),
    ReceiveAndAnswer,
}

impl ControllerThread {
    fn start(bus: &TestBus) -> Self {
        let (orders, received) = channel();
        let (done, outcomes) = channel();
        let bus = bus.clone();
        let thread = thread::spawn(move || {
            let (mut end, begun) = bus.controller(PATIENT).unwrap();
            assert_eq!(begun, session());
            for order in received {
                let outcome = match order {
                    Order::Receive => outcome(end.receive()),
                    Order::Answer(tick) => {
                        end.send(&answer(&sensor(tick))).unwrap();
                        Outcome::Done
                    }
                    Order::ReceiveAndAnswer => {
                        let Ok(Received::Frame(frame)) = end.receive() else {
                            panic!("no frame in lockstep");
                        };
                        end.send(&answer(&frame)).unwrap();
                        Outcome::Done
                    }
                };
                done.send(outcome).unwrap();
            }
        });
        Self {
            orders,
            outcomes,
            thread: Some(thread),
        }
    }

    fn order(&self, order: Order) {
        self.orders.send(order).unwrap();
    }

    fn outcome(&self) -> Outcome {
        self.outcomes.recv_timeout(PATIENT).unwrap()
    }

    /// Leaves the bus.
    fn end(mut self) {
        let (closed, _) = channel();
        self.orders = closed;
        self.thread.take().unwrap().join().unwrap();
    }
}

fn outcome(received: Result<Received, LinkError>) -> Outcome {
    match received {
        Ok(Received::Frame(frame)) => Outcome::Frame(frame.tick),
        Ok(Received::End) => Outcome::End,
        Err(LinkError::PlantGone { .. }) => Outcome::PlantGone,
        Err(other) => panic!("{other}"),
    }
}

struct Ends {
    bus: TestBus,
    plant: Option<PlantEnd>,
    controller: Option<ControllerThread>,
    next: u32,
}

impl Ends {
    fn numbers(&mut self, count: u32) -> std::ops::Range<u32> {
        let first = self.next;
        self.next += count;
        first..self.next
    }

    fn plant(&mut self) -> &mut PlantEnd {
        self.plant.as_mut().unwrap()
    }

    fn controller(&self) -> &ControllerThread {
        self.controller.as_ref().unwrap()
    }

    fn step(&mut self, step: Step) -> Outcome {
        match step {
            Step::StartPlant => self.plant = Some(self.bus.plant().unwrap()),
            Step::StartSecondPlant => {
                let second = self.bus.plant().err();
                assert!(matches!(second, Some(LinkError::BusInUse { .. })));
                return Outcome::Refused;
            }
            Step::Join => {
                self.controller = Some(ControllerThread::start(&self.bus));
                self.plant().wait_for_controller(PATIENT).unwrap();
            }
            Step::StartSecondController => {
                let second = self.bus.controller(SHORT).err();
                assert!(matches!(second, Some(LinkError::ControllerInUse { .. })));
                return Outcome::Refused;
            }
            Step::Send(count) => {
                for tick in self.numbers(count) {
                    self.plant().send(&sensor(tick)).unwrap();
                }
            }
            Step::Receive => {
                self.controller().order(Order::Receive);
                return self.controller().outcome();
            }
            Step::Answer(count) => {
                for tick in self.numbers(count) {
                    self.controller().order(Order::Answer(tick));
                    self.controller().outcome();
                }
            }
            Step::TakeAnswer => {
                return match self.plant().try_receive() {
                    Ok(Some(answer)) => Outcome::Answer(answer.tick),
                    Ok(None) => Outcome::NoAnswer,
                    Err(LinkError::ControllerGone { .. }) => Outcome::NoAnswerOrGone,
                    Err(other) => panic!("{other}"),
                };
            }
            Step::Exchange => {
                let tick = self.numbers(1).start;
                self.controller().order(Order::ReceiveAndAnswer);
                let answered = self.plant().exchange(&sensor(tick)).unwrap();
                self.controller().outcome();
                return Outcome::Answer(answered.tick);
            }
            Step::EndPlant => self.plant.take().unwrap().end().unwrap(),
            Step::DropPlant => drop(self.plant.take()),
            Step::DropController => self.controller.take().unwrap().end(),
        }
        Outcome::Done
    }
}

struct BusTest;

impl StateMachineTest for BusTest {
    type SystemUnderTest = Ends;
    type Reference = BusReference;

    fn init_test(_: &BusModel) -> Ends {
        Ends {
            bus: TestBus::new(),
            plant: None,
            controller: None,
            next: 0,
        }
    }

    fn apply(mut ends: Ends, model: &BusModel, step: Step) -> Ends {
        match (ends.step(step), &model.expected) {
            (Outcome::NoAnswer, Outcome::NoAnswerOrGone) => {}
            (outcome, expected) => assert_eq!(&outcome, expected, "{step:?}"),
        }
        ends
    }

    /// Checks that nothing remains, whichever end leaves first.
    fn teardown(mut ends: Ends, model: BusModel) {
        if model.next.is_multiple_of(2) {
            drop(ends.plant.take());
        }
        if let Some(controller) = ends.controller.take() {
            controller.end();
        }
        drop(ends.plant.take());
        ends.bus.assert_nothing_left();
    }
}

/// Some steps wait until a peer is found missing, so each case takes a while.
const CASES: u32 = 24;

fn config() -> ProptestConfig {
    let mut config = ProptestConfig::default();
    if std::env::var_os("PROPTEST_CASES").is_none() {
        config.cases = CASES;
    }
    config
}

prop_state_machine! {
    #![proptest_config(config())]

    #[test]
    fn both_ends_agree_with_their_model(sequential 1..40 => BusTest);
}
