//! The parameters of an arm's geometry, and what is known of them beforehand.

use nalgebra::SVector;

/// Names of the joints in messages, by index.
pub const JOINT_NAMES: [&str; 2] = ["joint 1", "the elbow"];

/// Number of parameters.
pub const COUNT: usize = 13;

/// One number for each parameter.
pub type Values = SVector<f64, COUNT>;

/// One parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Parameter {
    /// Constant that is added to an encoder's angle, rad.
    Zero(usize),
    /// Amplitude of the sine of the joint's angle that is added, rad.
    Sine(usize),
    /// The same of the cosine.
    Cosine(usize),
    /// The same of the sine of twice the angle.
    SecondSine(usize),
    /// The same of the cosine of twice the angle.
    SecondCosine(usize),
    /// Length of the first link, m.
    Length,
    /// Length of the second link over that of the first.
    Ratio,
    /// Distance of the first joint from the belt, m.
    Height,
}

impl Parameter {
    /// Every parameter, in the order of [`Values`].
    pub const ALL: [Self; COUNT] = [
        Self::Zero(0),
        Self::Zero(1),
        Self::Sine(0),
        Self::Sine(1),
        Self::Cosine(0),
        Self::Cosine(1),
        Self::SecondSine(0),
        Self::SecondSine(1),
        Self::SecondCosine(0),
        Self::SecondCosine(1),
        Self::Length,
        Self::Ratio,
        Self::Height,
    ];

    /// Returns the place in [`Values`].
    pub fn index(self) -> usize {
        match self {
            Self::Zero(joint) => joint,
            Self::Sine(joint) => 2 + joint,
            Self::Cosine(joint) => 4 + joint,
            Self::SecondSine(joint) => 6 + joint,
            Self::SecondCosine(joint) => 8 + joint,
            Self::Length => 10,
            Self::Ratio => 11,
            Self::Height => 12,
        }
    }

    /// Returns the unit; empty for a ratio.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Length | Self::Height => "m",
            Self::Ratio => "",
            _ => "rad",
        }
    }

    /// Returns what follows a number: a space and the unit, or nothing.
    pub(crate) fn unit_after_number(self) -> String {
        match self.unit() {
            "" => String::new(),
            unit => format!(" {unit}"),
        }
    }
}

impl core::fmt::Display for Parameter {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let mut of_joint = |what: &str, joint: usize| write!(f, "{what} of {}", JOINT_NAMES[joint]);
        match *self {
            Self::Zero(joint) => of_joint("zero of the encoder", joint),
            Self::Sine(joint) => of_joint("sine of the error", joint),
            Self::Cosine(joint) => of_joint("cosine of the error", joint),
            Self::SecondSine(joint) => of_joint("second sine of the error", joint),
            Self::SecondCosine(joint) => of_joint("second cosine of the error", joint),
            Self::Length => f.write_str("length of link 1"),
            Self::Ratio => f.write_str("length of link 2 over that of link 1"),
            Self::Height => f.write_str("height of joint 1 over the belt"),
        }
    }
}

/// Values of all parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters(pub Values);

impl Parameters {
    /// Returns those of an arm with perfect encoders: the lengths of its links and the height of joint 1, m.
    pub fn of_arm(link_length_m: [f64; 2], height_m: f64) -> Self {
        let mut values = Values::zeros();
        values[Parameter::Length.index()] = link_length_m[0];
        values[Parameter::Ratio.index()] = link_length_m[1] / link_length_m[0];
        values[Parameter::Height.index()] = height_m;
        Self(values)
    }

    /// Returns one of them.
    pub fn get(&self, parameter: Parameter) -> f64 {
        self.0[parameter.index()]
    }

    /// Sets one of them.
    pub fn set(&mut self, parameter: Parameter, value: f64) {
        self.0[parameter.index()] = value;
    }

    /// Lengths of both links, m.
    pub fn link_length_m(&self) -> [f64; 2] {
        let length = self.get(Parameter::Length);
        [length, length * self.get(Parameter::Ratio)]
    }
}

/// What is known before a slide: values and their standard deviations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prior {
    /// The values.
    pub parameters: Parameters,
    /// Their standard deviations.
    pub deviations: Values,
}

/// How well an arm is known that has been drawn and commissioned: standard deviations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drawn {
    /// Zeros of the encoders, by plumb line and eye, rad.
    pub zero_rad: f64,
    /// Each harmonic of an encoder's error once around, rad: an AS5048A with its magnet 0.25 mm off.
    pub harmonic_rad: f64,
    /// The same twice around.
    pub second_harmonic_rad: f64,
    /// Length of link 1, as a part of it.
    pub length: f64,
    /// Ratio of the links' lengths, as a part of it.
    pub ratio: f64,
    /// Height of the belt, as a part of it.
    pub height: f64,
}

impl Default for Drawn {
    fn default() -> Self {
        Self {
            zero_rad: 0.03,
            harmonic_rad: 0.005,
            second_harmonic_rad: 0.0015,
            length: 0.006,
            ratio: 0.008,
            height: 0.015,
        }
    }
}

impl Drawn {
    /// Returns the prior knowledge of an arm with these parameters.
    pub fn prior(&self, parameters: Parameters) -> Prior {
        let mut deviations = Values::zeros();
        for parameter in Parameter::ALL {
            let value = parameters.get(parameter);
            deviations[parameter.index()] = match parameter {
                Parameter::Zero(_) => self.zero_rad,
                Parameter::Sine(_) | Parameter::Cosine(_) => self.harmonic_rad,
                Parameter::SecondSine(_) | Parameter::SecondCosine(_) => self.second_harmonic_rad,
                Parameter::Length => self.length * value,
                Parameter::Ratio => self.ratio * value,
                Parameter::Height => self.height * value,
            };
        }
        Prior {
            parameters,
            deviations,
        }
    }
}
