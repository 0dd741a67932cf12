//! The arm on its belt as an FMU for co-simulation (FMI 3.0): torques in, motion and contact out.
//!
//! The names of the parameters are those of a scenario's keys.

use fmi::fmi3::{Fmi3Error, Fmi3Res};
use fmi_export::FmuModel;
use fmi_export::fmi3::{
    CSDoStepResult, Context, DefaultLoggingCategory, ModelLoggingCategory, UserModel,
};
use painleve_plant::mechanics::BuiltInPlant;
use painleve_plant::scenario::Scenario;
use painleve_plant::{Plant, Snapshot};
use painleve_shared::JointTorque;

/// The scenario whose settings the parameters change.
const SCENARIO: &str = "open-loop-bounce";

/// Variables of the FMU, and the plant behind them.
#[derive(Default, FmuModel)]
#[model(
    description = "Two-link arm whose tip touches a moving belt, with impacts and the Painlevé paradox",
    model_exchange = false,
    co_simulation = true,
    user_model = false
)]
struct ArmOnBelt {
    /// Settings of the plant, one `key=value` per line as after `painleve run --set`; the other parameters are applied after them
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
    plant: Option<Running>,
}

/// A plant in motion.
struct Running {
    plant: BuiltInPlant,
    /// Time of the simulation at the plant's time zero, s.
    start_s: f64,
    /// Present time of the simulation, s.
    now_s: f64,
}

impl ArmOnBelt {
    /// Creates the plant at rest in its initial posture.
    fn plant(&self) -> Result<BuiltInPlant, Box<dyn std::error::Error>> {
        let mut overrides: Vec<String> = self.settings.lines().map(str::to_owned).collect();
        overrides.retain(|line| !line.trim().is_empty());
        overrides.extend([
            format!("belt.friction={:?}", self.friction),
            format!(
                "belt.profile={{ kind = 'constant', speed_m_s = {:?} }}",
                self.belt_speed_m_s
            ),
            format!("impact.restitution={:?}", self.restitution),
            format!("initial.theta1_deg={:?}", self.initial_theta1_deg),
            format!("initial.theta2_deg={:?}", self.initial_theta2_deg),
        ]);
        let scenario = Scenario::load(SCENARIO, &overrides)?;
        Ok(BuiltInPlant::new(&scenario)?)
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

/// Reports why a call failed: in the simulator's log, or on standard error if that log is off.
fn failed(context: &dyn Context<ArmOnBelt>, cause: impl std::fmt::Display) -> Fmi3Error {
    let category = DefaultLoggingCategory::error_category();
    if context.logging_on(category) {
        context.log(Fmi3Error::Error.into(), category, format_args!("{cause}"));
    } else {
        eprintln!("painleve: {cause}");
    }
    Fmi3Error::Error
}

impl UserModel for ArmOnBelt {
    type LoggingCategory = DefaultLoggingCategory;

    /// Starts the plant when initialization mode ends.
    fn configurate(&mut self, context: &dyn Context<Self>) -> Result<(), Fmi3Error> {
        let plant = self.plant().map_err(|cause| failed(context, cause))?;
        self.show(&plant.snapshot());
        self.plant = Some(Running {
            plant,
            start_s: context.time(),
            now_s: context.time(),
        });
        Ok(())
    }

    /// Shows the plant's state; before its start or after a reset, that of a new plant.
    fn calculate_values(&mut self, context: &dyn Context<Self>) -> Result<Fmi3Res, Fmi3Error> {
        let now = match &self.plant {
            Some(running) if running.now_s == context.time() => running.plant.snapshot(),
            _ => self
                .plant()
                .map_err(|cause| failed(context, cause))?
                .snapshot(),
        };
        self.show(&now);
        Ok(Fmi3Res::OK)
    }

    /// Holds the torques for a step; steps may have any length.
    fn do_step(
        &mut self,
        context: &mut dyn Context<Self>,
        from_s: f64,
        step_s: f64,
        _: bool,
    ) -> Result<CSDoStepResult, Fmi3Error> {
        let until_s = from_s + step_s;
        let torque_nm = JointTorque::new(self.u1_nm, self.u2_nm);
        let Some(running) = &mut self.plant else {
            return Err(failed(context, "the plant has not been started"));
        };
        let Running { plant, start_s, .. } = running;
        plant.command_torque(torque_nm, 0.0);
        if let Err(cause) = plant.advance(until_s - *start_s, &mut ()) {
            return Err(failed(context, cause));
        }
        running.now_s = until_s;
        let now = running.plant.snapshot();
        self.show(&now);
        context.set_time(until_s);
        Ok(CSDoStepResult::completed(until_s))
    }
}

fmi_export::export_fmu!(ArmOnBelt);
