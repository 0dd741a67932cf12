//! Effects of instructions on registers that are used for addresses.

use capstone::arch::arm::{ArmOperand, ArmOperandType};

/// Effect of an instruction on a register that is used for addresses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effect {
    /// The register is set to a constant.
    Set(u16, u32),
    /// The register's upper half is set to a constant.
    SetUpper(u16, u32),
    /// The register is set to the sum of another register and a constant.
    Add(u16, u16, i32),
    /// The register is set to the sum of two others, of which one may be shifted.
    AddRegister(u16, u16, u16),
    /// The register, the base of a memory access, is moved on.
    Advance(u16),
}

/// Returns the effect of an instruction on a register used for addresses.
pub(crate) fn effect(
    name: &str,
    operands: &[ArmOperand],
    immediate: Option<i32>,
    conditional: bool,
) -> Option<Effect> {
    let register = |place: usize| match operands.get(place).map(|operand| &operand.op_type) {
        Some(ArmOperandType::Reg(register)) => Some(register.0),
        _ => None,
    };
    let to = register(0)?;
    if conditional {
        return None;
    }
    match (name, operands.len(), register(1), register(2)) {
        ("mov" | "movs", 2, Some(from), _) => return Some(Effect::Add(to, from, 0)),
        ("add" | "adds", 3, Some(one), Some(other)) => {
            return Some(Effect::AddRegister(to, one, other));
        }
        ("add" | "adds", 2, Some(other), _) => return Some(Effect::AddRegister(to, to, other)),
        _ => {}
    }
    let value = immediate?;
    match (name, operands.len()) {
        ("mov" | "movs" | "movw", 2) => Some(Effect::Set(to, value as u32)),
        ("movt", 2) => Some(Effect::SetUpper(to, value as u32)),
        ("add" | "adds" | "addw", 3) => Some(Effect::Add(to, register(1)?, value)),
        ("add" | "adds", 2) => Some(Effect::Add(to, to, value)),
        ("sub" | "subs" | "subw", 3) => Some(Effect::Add(to, register(1)?, -value)),
        ("sub" | "subs", 2) => Some(Effect::Add(to, to, -value)),
        _ => None,
    }
}
