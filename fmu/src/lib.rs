//! The arm on its belt as an FMU for co-simulation (FMI 3.0): torques in, motion and contact out.
//!
//! The names of the parameters are those of a scenario's keys.

mod interface;

use fmi_export::FmuModel;
use fmi_export::fmi3::Model;
use painleve_plant::mechanics::BuiltInPlant;
use painleve_plant::scenario::{Scenario, first_outside, sets};
use painleve_plant::{Plant, Snapshot};
use painleve_shared::JointTorque;

/// The scenario whose settings the parameters change.
const SCENARIO: &str = "open-loop-bounce";

/// Keys of a scenario that a parameter decides, which would overwrite them without a word.
const OWN_PARAMETERS: [(&str, &str); 5] = [
    ("belt.friction", "belt.friction"),
    ("belt.profile", "belt.speed_m_s"),
    ("impact.restitution", "impact.restitution"),
    ("initial.theta1_deg", "initial.theta1_deg"),
    ("initial.theta2_deg", "initial.theta2_deg"),
];

/// Tables of a scenario that decide the plant; the others would change nothing.
const USED: [&str; 7] = [
    "arm", "belt", "contact", "effects", "impact", "initial", "solver",
];

/// The key that starts the arm with its tip on the belt, instead of the two angles.
const TIP: &str = "initial.tip_m";

/// Longest communication step, s: some seconds of computation.
const LONGEST_STEP_S: f64 = 3600.0;
/// Largest difference of a communication point from the plant's own time, and of the end from the stop time, as a part
/// of either, and at most a tenth of the step: simulators add up their steps in several ways.
const TIME_TOLERANCE: f64 = 1e-9;

/// Why a call fails, in one sentence.
type Failure = Box<dyn std::error::Error>;

/// Variables of the FMU, and the plant behind them.
#[derive(Default, FmuModel)]
#[model(
    description = "Two-link arm whose tip touches a moving belt, with impacts and the Painlevé paradox",
    model_exchange = false,
    co_simulation = true
)]
struct ArmOnBelt {
    /// Settings of the plant, one `key=value` per line as after `painleve run --set`; keys of the other parameters, and those that are not of the plant, are refused; initial.tip_m decides the start instead of the two angles
    #[variable(name = "settings", causality = Parameter, variability = Fixed, start = String::new(), initial = Exact)]
    settings: String,
    /// Friction coefficient between tip and belt
    #[variable(name = "belt.friction", causality = Parameter, variability = Fixed, start = 0.6, initial = Exact)]
    friction: f64,
    /// Velocity of the belt, m/s
    #[variable(name = "belt.speed_m_s", causality = Parameter, variability = Fixed, start = -0.4, initial = Exact)]
    belt_speed_m_s: f64,
    /// Coefficient of restitution of impacts
    #[variable(name = "impact.restitution", causality = Parameter, variability = Fixed, start = 0.1, initial = Exact)]
    restitution: f64,
    /// Initial angle of link 1 from the belt's inward normal, degrees
    #[variable(name = "initial.theta1_deg", causality = Parameter, variability = Fixed, start = 32.0, initial = Exact)]
    initial_theta1_deg: f64,
    /// Initial angle of link 2 from the belt's inward normal, degrees
    #[variable(name = "initial.theta2_deg", causality = Parameter, variability = Fixed, start = 18.27, initial = Exact)]
    initial_theta2_deg: f64,

    /// Torque of joint 1, N·m, held during a step
    #[variable(causality = Input, variability = Continuous, start = 0.0)]
    u1_nm: f64,
    /// Torque of joint 2, N·m, held during a step
    #[variable(causality = Input, variability = Continuous, start = 0.0)]
    u2_nm: f64,

    /// Angle of link 1 from the belt's inward normal, rad
    #[variable(causality = Output, variability = Continuous, initial = Calculated)]
    theta1_rad: f64,
    /// Angle of link 2 from the belt's inward normal, rad
    #[variable(causality = Output, variability = Continuous, initial = Calculated)]
    theta2_rad: f64,
    /// Rate of theta1_rad, rad/s
    #[variable(causality = Output, variability = Continuous, initial = Calculated)]
    theta1_dot_rad_s: f64,
    /// Rate of theta2_rad, rad/s
    #[variable(causality = Output, variability = Continuous, initial = Calculated)]
    theta2_dot_rad_s: f64,
    /// Position of the tip along the belt, m
    #[variable(causality = Output, variability = Continuous, initial = Calculated)]
    tip_t_m: f64,
    /// Height of the tip above the belt, m
    #[variable(causality = Output, variability = Continuous, initial = Calculated)]
    gap_m: f64,
    /// Velocity of the tip relative to the belt, m/s
    #[variable(causality = Output, variability = Continuous, initial = Calculated)]
    slip_velocity_m_s: f64,
    /// Normal force of the belt on the tip, N
    #[variable(causality = Output, variability = Continuous, initial = Calculated)]
    normal_force_n: f64,
    /// Tangential force of the belt on the tip, N
    #[variable(causality = Output, variability = Continuous, initial = Calculated)]
    tangential_force_n: f64,
    /// Contact mode: 0 flight, 1 and 2 sliding forwards and backwards, 3 sticking
    #[variable(causality = Output, variability = Discrete, initial = Calculated)]
    contact_mode: i32,

    #[variable(skip = true)]
    times: Times,
    #[variable(skip = true)]
    plant: Option<BuiltInPlant>,
}

/// Times of the simulation, s.
#[derive(Clone, Copy, Debug, Default)]
struct Times {
    /// That of the plant's time zero.
    start_s: f64,
    now_s: f64,
    stop_s: Option<f64>,
}

impl ArmOnBelt {
    /// Returns the variables at their start values, without a plant.
    fn at_start() -> Self {
        let mut arm = Self::default();
        arm.set_start_values();
        arm
    }

    /// Returns the torques of the inputs.
    fn torque_nm(&self) -> Result<JointTorque<f64>, Failure> {
        let (u1_nm, u2_nm) = (self.u1_nm, self.u2_nm);
        if !(u1_nm.is_finite() && u2_nm.is_finite()) {
            let torques = format!("u1_nm = {u1_nm}, u2_nm = {u2_nm}");
            return Err(format!("{torques}: torques are finite numbers").into());
        }
        Ok(JointTorque::new(u1_nm, u2_nm))
    }

    /// Returns the plant of the present parameters and inputs, in its initial posture.
    fn new_plant(&self) -> Result<BuiltInPlant, Failure> {
        let mut overrides: Vec<String> = self.settings.lines().map(str::to_owned).collect();
        overrides.retain(|line| !line.trim().is_empty());
        for setting in &overrides {
            let taken = |(key, parameter)| Some((sets(setting, key)?, parameter));
            if let Some((key, parameter)) = OWN_PARAMETERS.into_iter().find_map(taken) {
                let decided = format!("{key} is decided by the parameter {parameter}");
                return Err(format!("settings: {decided}").into());
            }
        }
        // A misspelt key is reported as misspelt first.
        Scenario::load_unplaced(SCENARIO, &overrides)?;
        if let Some(key) = first_outside(&overrides, &USED) {
            let used = USED.join(", ");
            let refused = format!("{key} has no effect here; set keys of {used}");
            return Err(format!("settings: {refused}").into());
        }
        let has_tip = overrides.iter().any(|setting| sets(setting, TIP).is_some());
        // TOML writes nan where Rust writes NaN; the scenario then names the range.
        let number = |value: f64| format!("{value:?}").to_lowercase();
        overrides.extend([
            format!("belt.friction={}", number(self.friction)),
            format!(
                "belt.profile={{ kind = 'constant', speed_m_s = {} }}",
                number(self.belt_speed_m_s)
            ),
            format!("impact.restitution={}", number(self.restitution)),
        ]);
        if has_tip {
            self.refuse_angles()?;
        } else {
            overrides.extend([
                format!("initial.theta1_deg={}", number(self.initial_theta1_deg)),
                format!("initial.theta2_deg={}", number(self.initial_theta2_deg)),
            ]);
        }
        let scenario = Scenario::load(SCENARIO, &overrides)?;
        let mut plant = BuiltInPlant::new(&scenario)?;
        plant.command_torque(self.torque_nm()?, 0.0);
        // Until it first advances, a plant only guesses the mode of a tip on the belt.
        plant.advance(0.0, &mut ())?;
        Ok(plant)
    }

    /// Refuses angles that differ from their start values, which nothing would read.
    fn refuse_angles(&self) -> Result<(), Failure> {
        let start = Self::at_start();
        let angles = [
            (
                "initial.theta1_deg",
                self.initial_theta1_deg,
                start.initial_theta1_deg,
            ),
            (
                "initial.theta2_deg",
                self.initial_theta2_deg,
                start.initial_theta2_deg,
            ),
        ];
        match angles.into_iter().find(|(_, angle, start)| angle != start) {
            Some((name, angle, start)) => Err(format!(
                "{name} = {angle} has no effect here: {TIP} in settings decides the start; leave {name} = {start}"
            )
            .into()),
            None => Ok(()),
        }
    }

    /// Sets the time at which the simulation starts and the one at which it must have ended, s.
    fn set_times(&mut self, start_s: f64, stop_s: Option<f64>) -> Result<(), Failure> {
        if !start_s.is_finite() {
            return Err(format!("startTime = {start_s} is not a finite number").into());
        }
        if let Some(stop_s) = stop_s
            && !(stop_s.is_finite() && stop_s > start_s)
        {
            return Err(format!("stopTime = {stop_s} is not after startTime = {start_s}").into());
        }
        self.times = Times {
            start_s,
            now_s: start_s,
            stop_s,
        };
        Ok(())
    }

    /// Shows what a plant of the present parameters and inputs would be.
    fn show_start(&mut self) -> Result<(), Failure> {
        let plant = self.new_plant()?;
        self.show(&plant.snapshot());
        Ok(())
    }

    /// Starts the plant of the present parameters and inputs.
    fn start(&mut self) -> Result<(), Failure> {
        let plant = self.new_plant()?;
        self.show(&plant.snapshot());
        self.plant = Some(plant);
        Ok(())
    }

    /// Holds the torques for a communication step of `step_s` from the communication point `point_s`.
    fn step(&mut self, point_s: f64, step_s: f64) -> Result<(), Failure> {
        let Times {
            start_s,
            now_s,
            stop_s,
        } = self.times;
        // Both comparisons are false for NaN.
        if !(step_s > 0.0 && step_s <= LONGEST_STEP_S) {
            let limit = format!("a step is above 0 s and at most {LONGEST_STEP_S} s");
            return Err(format!("communicationStepSize = {step_s}: {limit}").into());
        }
        let tolerance_s = |time_s: f64| (TIME_TOLERANCE * time_s.abs().max(1.0)).min(0.1 * step_s);
        let is_at_point = (point_s - now_s).abs() <= tolerance_s(now_s);
        if !is_at_point {
            let expected = format!("the plant is at {now_s} s");
            return Err(format!("currentCommunicationPoint = {point_s}: {expected}").into());
        }
        let until_s = point_s + step_s;
        if until_s <= now_s {
            return Err(format!("communicationStepSize = {step_s} is lost in {point_s} s").into());
        }
        if let Some(stop_s) = stop_s
            && until_s > stop_s + tolerance_s(stop_s)
        {
            return Err(format!("the step ends at {until_s} s, after stopTime = {stop_s}").into());
        }
        let torque_nm = self.torque_nm()?;
        let plant = self.plant.as_mut().ok_or("there is no plant")?;
        plant.command_torque(torque_nm, 0.0);
        let advanced = plant.advance(until_s - start_s, &mut ());
        let now = plant.snapshot();
        self.show(&now);
        self.times.now_s = advanced.as_ref().map_or(start_s + now.time_s, |()| until_s);
        Ok(advanced?)
    }

    /// Returns the present time of the simulation, s.
    fn now_s(&self) -> f64 {
        self.times.now_s
    }

    /// Writes the time to a value if it is of the time's type.
    fn put_time(&self, value: &mut dyn std::any::Any) -> bool {
        let value = value.downcast_mut::<f64>();
        value.map(|value| *value = self.now_s()).is_some()
    }

    /// Copies a state to the outputs.
    fn show(&mut self, now: &Snapshot) {
        self.theta1_rad = now.theta_rad.first();
        self.theta2_rad = now.theta_rad.second();
        self.theta1_dot_rad_s = now.theta_dot_rad_s.first();
        self.theta2_dot_rad_s = now.theta_dot_rad_s.second();
        self.tip_t_m = now.tip_t_m;
        self.gap_m = now.gap_m;
        self.slip_velocity_m_s = now.slip_velocity_m_s;
        self.normal_force_n = now.normal_force_n;
        self.tangential_force_n = now.tangential_force_n;
        self.contact_mode = now.mode as i32;
    }
}
