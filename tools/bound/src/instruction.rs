//! Decoded instructions of the image, with their cost and control flow.
//!
//! The decoder is capstone: it supports all of Thumb-2 and the floating-point instructions, and its
//! operands show which registers are read and written. `yaxpeax-arm` is lighter but lacks floating
//! point; LLVM's tools would have to be installed and their text parsed.

use capstone::RegId;
use capstone::arch::arm::{ArmCC, ArmInsn, ArmOperand, ArmOperandType, ArmReg};
use capstone::prelude::*;

use crate::BoundError;
use crate::cycles::InstructionKind;
use crate::effect::{Effect, effect};
use crate::image::Image;

/// Control flow after an instruction.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Flow {
    /// Continues with the next instruction.
    Next,
    /// Branches to an address; a conditional branch may also continue.
    Branch {
        /// Target address.
        target: u32,
        /// Whether execution may also continue with the next instruction.
        conditional: bool,
    },
    /// Calls a function, then continues with the next instruction.
    Call {
        /// The function.
        target: u32,
        /// Whether the call depends on a condition.
        conditional: bool,
    },
    /// Returns to the caller; a conditional return may also continue.
    Return {
        /// Whether execution may also continue with the next instruction.
        conditional: bool,
    },
    /// Branches to an entry of the table after it.
    Table,
    /// Stops: an intentionally undefined instruction.
    Trap,
}

/// Loads and stores of one register of the core that the pipeline overlaps with their neighbours (TRM, section
/// 3.3.2): without update of the base register, and not relative to the program counter. 32-bit
/// instructions at an odd half-word, which "might not pipeline optimally" (TRM, table 3-1, note b), are not
/// counted among them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Overlap {
    /// Load.
    Load,
    /// Store to a register's value plus a constant.
    Store,
    /// Store to the sum of two registers.
    StoreIndexed,
}

/// One decoded instruction.
#[derive(Clone, Debug)]
pub struct Instruction {
    /// Address.
    pub address: u32,
    /// Length in bytes: 2 or 4.
    pub size: u32,
    /// Kind, which determines the cost.
    pub kind: InstructionKind,
    /// Control flow.
    pub flow: Flow,
    /// Base register and offset of its memory access.
    pub memory: Option<(u16, i32)>,
    /// Registers from which the address of its memory access is computed.
    pub address_from: Vec<u16>,
    /// Whether it is a load or store that the pipeline can overlap with its neighbours.
    pub overlap: Option<Overlap>,
    /// Its effect on a register used for addresses.
    pub effect: Option<Effect>,
    /// Registers read.
    pub reads: Vec<u16>,
    /// Registers written.
    pub writes: Vec<u16>,
    /// Disassembly.
    pub text: String,
}

impl Instruction {
    /// Checks that its cost is known.
    ///
    /// # Errors
    /// [`BoundError::UnknownInstruction`].
    pub fn check(&self) -> Result<(), BoundError> {
        if self.kind != InstructionKind::Unknown {
            return Ok(());
        }
        Err(BoundError::UnknownInstruction {
            address: self.address,
            text: self.text.clone(),
        })
    }

    /// Returns whether it loads from memory.
    pub fn loads(&self) -> bool {
        matches!(
            self.kind,
            InstructionKind::Load(_) | InstructionKind::TableBranch
        )
    }

    /// Returns the number of words that it loads or stores; `None` if it accesses no memory.
    pub fn words(&self) -> Option<u32> {
        match self.kind {
            InstructionKind::Load(words) | InstructionKind::Store(words) => Some(words),
            InstructionKind::TableBranch => Some(1),
            _ => None,
        }
    }

    /// Returns whether it uses the floating-point unit.
    pub fn uses_float(&self) -> bool {
        self.text.starts_with('v')
    }

    /// Returns whether it makes the following instructions conditional.
    pub fn is_it(&self) -> bool {
        self.text.starts_with("it")
    }
}

/// Decodes the instructions of an image.
pub struct Decoder(Capstone);

/// Registers that hold a function's arguments.
pub const ARGUMENTS: [u16; 4] = [
    ArmReg::ARM_REG_R0 as u16,
    ArmReg::ARM_REG_R1 as u16,
    ArmReg::ARM_REG_R2 as u16,
    ArmReg::ARM_REG_R3 as u16,
];

/// Number of the stack pointer.
pub const STACK_POINTER: u16 = ArmReg::ARM_REG_SP as u16;

/// Number of the program counter.
pub const PROGRAM_COUNTER: u16 = ArmReg::ARM_REG_PC as u16;

/// Registers that a function keeps, r4 to r11 (ARM's procedure call standard, AAPCS32, section 6.1.1).
pub const KEPT_BY_CALLS: [u16; 8] = [
    ArmReg::ARM_REG_R4 as u16,
    ArmReg::ARM_REG_R5 as u16,
    ArmReg::ARM_REG_R6 as u16,
    ArmReg::ARM_REG_R7 as u16,
    ArmReg::ARM_REG_R8 as u16,
    ArmReg::ARM_REG_R9 as u16,
    ArmReg::ARM_REG_R10 as u16,
    ArmReg::ARM_REG_R11 as u16,
];

impl Decoder {
    /// Creates a decoder for the Cortex-M4F.
    ///
    /// # Errors
    /// [`BoundError::Decoder`] if the library fails.
    pub fn new() -> Result<Self, BoundError> {
        let decoder = Capstone::new()
            .arm()
            .mode(capstone::arch::arm::ArchMode::Thumb)
            .extra_mode([capstone::arch::arm::ArchExtraMode::MClass].into_iter())
            .detail(true)
            .build();
        decoder.map(Self).map_err(BoundError::Decoder)
    }

    /// Decodes the instruction at an address. `conditional` states whether a preceding IT
    /// instruction makes it conditional.
    ///
    /// # Errors
    /// [`BoundError`] if there is no instruction, or its destination is unknown.
    pub fn at(
        &self,
        image: &Image,
        address: u32,
        conditional: bool,
    ) -> Result<Instruction, BoundError> {
        let unknown = |text: &str| BoundError::UnknownInstruction {
            address,
            text: text.to_owned(),
        };
        let bytes = image.bytes(address).ok_or_else(|| unknown("no code"))?;
        let found = self
            .0
            .disasm_count(&bytes[..bytes.len().min(4)], u64::from(address), 1)
            .map_err(BoundError::Decoder)?;
        let instruction = found
            .iter()
            .next()
            .ok_or_else(|| unknown("no instruction"))?;
        let detail = self
            .0
            .insn_detail(instruction)
            .map_err(BoundError::Decoder)?;
        let name = instruction.mnemonic().unwrap_or_default();
        let text = format!("{name} {}", instruction.op_str().unwrap_or_default());
        let arch = detail.arch_detail();
        let arm = arch.arm().ok_or_else(|| unknown(&text))?;
        let operands: Vec<ArmOperand> = arm.operands().collect();
        let conditional =
            conditional || !matches!(arm.cc(), ArmCC::ARM_CC_AL | ArmCC::ARM_CC_INVALID);

        let mut reads: Vec<u16> = detail.regs_read().iter().map(|r| r.0).collect();
        let mut writes: Vec<u16> = detail.regs_write().iter().map(|r| r.0).collect();
        let mut memory = None;
        let mut address_from = Vec::new();
        let mut has_index = false;
        for operand in &operands {
            match operand.op_type {
                ArmOperandType::Reg(RegId(register)) => {
                    let access = operand.access;
                    if access.is_none_or(|access| access.is_readable()) {
                        reads.push(register);
                    }
                    if access.is_none_or(|access| access.is_writable()) {
                        writes.push(register);
                    }
                }
                ArmOperandType::Mem(at) => {
                    reads.extend([at.base().0, at.index().0]);
                    has_index = at.index().0 != ArmReg::ARM_REG_INVALID as u16;
                    address_from = vec![at.base().0];
                    address_from.extend(has_index.then_some(at.index().0));
                    if arm.writeback() {
                        writes.push(at.base().0);
                    }
                    memory = Some((at.base().0, at.disp()));
                }
                _ => {}
            }
        }
        let registers = |skip: usize| {
            operands
                .iter()
                .skip(skip)
                .filter(|operand| matches!(operand.op_type, ArmOperandType::Reg(_)))
                .count() as u32
        };
        let doubles = |skip: usize| {
            operands
                .iter()
                .skip(skip)
                .map(|operand| match operand.op_type {
                    ArmOperandType::Reg(register) if is_double(register.0) => 2,
                    ArmOperandType::Reg(_) => 1,
                    _ => 0,
                })
                .sum::<u32>()
        };
        let immediate = operands.iter().find_map(|operand| match operand.op_type {
            ArmOperandType::Imm(value) => Some(value),
            _ => None,
        });
        let to_counter = writes.contains(&PROGRAM_COUNTER);
        let base = name.split('.').next().unwrap_or_default();
        let id = instruction.id().0;
        let is = |one: ArmInsn| id == one as u32;
        let any = |several: &[ArmInsn]| several.iter().any(|one| is(*one));

        use ArmInsn::*;
        let mut flow = Flow::Next;
        let kind = if is(ARM_INS_BL) {
            flow = Flow::Call {
                target: immediate.ok_or_else(|| unknown(&text))? as u32,
                conditional,
            };
            InstructionKind::Branch
        } else if any(&[ARM_INS_B, ARM_INS_CBZ, ARM_INS_CBNZ]) {
            let target = immediate.ok_or_else(|| unknown(&text))? as u32;
            let conditional = conditional || !is(ARM_INS_B);
            flow = Flow::Branch {
                target,
                conditional,
            };
            InstructionKind::Branch
        } else if is(ARM_INS_BX) && base.starts_with("bx") {
            if !reads.contains(&(ArmReg::ARM_REG_LR as u16)) {
                return Err(unknown(&text));
            }
            flow = Flow::Return { conditional };
            InstructionKind::Branch
        } else if any(&[ARM_INS_TBB, ARM_INS_TBH]) {
            flow = Flow::Table;
            InstructionKind::TableBranch
        } else if any(&[ARM_INS_UDF, ARM_INS_BKPT]) {
            flow = Flow::Trap;
            InstructionKind::Simple
        } else if any(&[ARM_INS_SDIV, ARM_INS_UDIV]) {
            InstructionKind::Divide
        } else if any(&[ARM_INS_ISB, ARM_INS_DSB, ARM_INS_DMB]) {
            InstructionKind::Barrier
        } else if any(&[ARM_INS_MRS, ARM_INS_MSR, ARM_INS_CPS]) {
            InstructionKind::Special
        } else if any(&[ARM_INS_VDIV, ARM_INS_VSQRT]) {
            InstructionKind::FloatDivide
        } else if any(&[
            ARM_INS_VMLA,
            ARM_INS_VMLS,
            ARM_INS_VNMLA,
            ARM_INS_VNMLS,
            ARM_INS_VFMA,
            ARM_INS_VFMS,
            ARM_INS_VFNMA,
            ARM_INS_VFNMS,
        ]) {
            InstructionKind::FloatMultiplyAdd
        } else if base == "vmov" && registers(0) > 2 {
            InstructionKind::FloatPair
        } else if any(&[ARM_INS_VLDR, ARM_INS_VPOP]) {
            InstructionKind::Load(doubles(0))
        } else if any(&[ARM_INS_VSTR, ARM_INS_VPUSH]) {
            InstructionKind::Store(doubles(0))
        } else if any(&[ARM_INS_VLDMIA, ARM_INS_VLDMDB]) {
            InstructionKind::Load(doubles(1))
        } else if any(&[ARM_INS_VSTMIA, ARM_INS_VSTMDB]) {
            InstructionKind::Store(doubles(1))
        } else if base.starts_with('v') {
            InstructionKind::Float
        } else if is(ARM_INS_POP) {
            InstructionKind::Load(registers(0))
        } else if is(ARM_INS_PUSH) {
            InstructionKind::Store(registers(0))
        } else if base.starts_with("ldm") {
            InstructionKind::Load(registers(1))
        } else if base.starts_with("stm") {
            InstructionKind::Store(registers(1))
        } else if base.starts_with("ldrd") {
            InstructionKind::Load(2)
        } else if base.starts_with("strd") {
            InstructionKind::Store(2)
        } else if base.starts_with("ldr") {
            InstructionKind::Load(1)
        } else if base.starts_with("str") {
            InstructionKind::Store(1)
        } else if SIMPLE.iter().any(|simple| base.starts_with(simple)) {
            InstructionKind::Simple
        } else {
            InstructionKind::Unknown
        };
        if to_counter && matches!(flow, Flow::Next) {
            if !matches!(kind, InstructionKind::Load(_)) || operands.iter().any(|o| matches!(o.op_type, ArmOperandType::Mem(m) if m.base().0 != ArmReg::ARM_REG_SP as u16)) {
                return Err(unknown(&text));
            }
            flow = Flow::Return { conditional };
        }
        let mut effect = effect(base, &operands, immediate, conditional);
        if any(&[ARM_INS_PUSH, ARM_INS_POP, ARM_INS_VPUSH, ARM_INS_VPOP]) {
            address_from = vec![ArmReg::ARM_REG_SP as u16];
        } else if memory.is_none()
            && matches!(kind, InstructionKind::Load(_) | InstructionKind::Store(_))
            && let Some(ArmOperandType::Reg(register)) = operands.first().map(|it| &it.op_type)
        {
            address_from = vec![register.0];
        }
        let loaded = |register: u16| {
            let mut names = operands.iter().map(|it| &it.op_type);
            let is =
                |it: &ArmOperandType| matches!(it, ArmOperandType::Reg(it) if it.0 == register);
            names.any(is)
        };
        if arm.writeback()
            && let Some(base) = address_from.first()
            && (memory.is_none() || !loaded(*base))
        {
            effect = Some(Effect::Advance(*base));
        }
        let bytes = instruction.bytes().len() as u32;
        let neighbours = (bytes == 2 || address.is_multiple_of(4))
            && !arm.writeback()
            && !base.starts_with('v')
            && memory.is_some_and(|(base, _)| base != PROGRAM_COUNTER)
            && matches!(flow, Flow::Next);
        let overlap = match kind {
            _ if !neighbours => None,
            InstructionKind::Load(1) => Some(Overlap::Load),
            InstructionKind::Store(1) if has_index => Some(Overlap::StoreIndexed),
            InstructionKind::Store(1) => Some(Overlap::Store),
            _ => None,
        };
        Ok(Instruction {
            address,
            size: bytes,
            kind,
            flow,
            memory,
            address_from,
            overlap,
            effect,
            reads,
            writes,
            text,
        })
    }
}

/// Prefixes of the mnemonics of one-cycle instructions (TRM, tables 3-1 and 3-2).
const SIMPLE: [&str; 65] = [
    "add", "adc", "sub", "sbc", "rsb", "mov", "mvn", "and", "orr", "orn", "eor", "bic", "cmp",
    "cmn", "tst", "teq", "lsl", "lsr", "asr", "ror", "rrx", "mul", "mla", "mls", "smul", "umul",
    "smla", "umla", "ubf", "sbf", "bf", "it", "nop", "uxt", "sxt", "rev", "rbit", "clz", "usat",
    "ssat", "adr", "neg", "sel", "uqadd", "uqsub", "uqasx", "uqsax", "uadd", "usub", "uhadd",
    "uhsub", "usad", "sadd", "ssub", "shadd", "shsub", "qadd", "qsub", "qdadd", "qdsub", "pkh",
    "smm", "smlsd", "smusd", "smuad",
];

fn is_double(register: u16) -> bool {
    (ArmReg::ARM_REG_D0 as u16..=ArmReg::ARM_REG_D31 as u16).contains(&register)
}
