#!/usr/bin/env python3
"""Writes src/registers/*.txt: which registers and bits the chips have, for the peripherals that the images use.

    cargo fetch && python3 sil-host/chips/registers.py

The source is not ours: the crates stm32f4 and stm32g4 (MIT or Apache-2.0), which the project stm32-rs generates from ST's own SVD
files, corrected by its users. A line is a peripheral: its name, its address, and for each register `offset=bits`, or `offset=bits:value` if it is not zero after a reset.
"""

import pathlib
import re
import subprocess
import json

FOLDER = pathlib.Path(__file__).parent
CHIPS = {
    ("stm32f4", "stm32f405"): "ADC1 ADC_COMMON DAC DBGMCU DMA1 DMA2 EXTI FLASH GPIOA GPIOB GPIOC GPIOH IWDG PWR RCC SPI1 SPI2"
    " SYSCFG TIM2 TIM5 USART1 WWDG",
    ("stm32g4", "stm32g474"): "ADC1 ADC2 ADC12_COMMON DAC1 DBGMCU DMA1 DMAMUX EXTI FLASH GPIOA GPIOB GPIOC GPIOF IWDG PWR RCC"
    " SPI1 SPI2 TIM2 USART2 WWDG",
}
REGISTER = re.compile(
    r"///0x([0-9a-f]+)(?:\.\.0x([0-9a-f]+))?[^\n]*\n\s*#\[inline\(always\)\]\s*pub const fn (\w+)\(&self(, n: usize)?\) -> &(\w+)"
)
FIELD = re.compile(r"\n    ///Bits? (\d+)(?::(\d+))?\b")


def bits(text):
    """Returns the bits of a register's fields, or all if it has none, and those that a reset sets: reserved ones keep their value.
    Returns the value after a reset, too."""
    mask = 0
    for first, last in FIELD.findall(text):
        mask |= (2 << int(last or first)) - (1 << int(first))
    width = {"u8": 8, "u16": 16, "u32": 32}[re.search(r"type Ux = (u\d+);", text)[1]]
    reset = re.search(r"const RESET_VALUE: u\d+ = (0x[0-9a-f_]+);", text)
    value = int(reset[1] if reset else "0", 16)
    return (mask or (1 << width) - 1) | value, value


def registers(module):
    """Returns the bits of each register in a module, and its value after a reset, by offset."""
    text = module.with_suffix(".rs").read_text()
    found = {}
    for first, end, name, is_indexed, kind in REGISTER.findall(text):
        first = int(first, 16)
        used = re.search(rf"pub use crate::\w+::(\w+)::{kind.lower()};", text)
        home = module.with_name(used[1]) if used else module
        file = home / f"{kind.lower()}.rs"
        if (home / kind.lower()).is_dir():
            inner = registers(home / kind.lower())
        else:
            inner = {0: bits(file.read_text())}
        count = 1
        if end and is_indexed:
            number = re.search(rf"\b{name}: \[{kind}; (\d+)\]", text)
            number = number or re.search(rf"\[\(\); (\d+)\]", text[text.index(f"fn {name}(&self, n"):])
            count = int(number[1])
        step = (int(end, 16) - first) // count if end else 0
        for place in range(count):
            for offset, (mask, value) in inner.items():
                at = first + place * step + offset
                other_mask, other_value = found.get(at, (0, 0))
                found[at] = other_mask | mask, other_value | value
    return found


def main():
    metadata = subprocess.run(["cargo", "metadata", "--format-version=1"], check=True, capture_output=True, cwd=FOLDER)
    packages = json.loads(metadata.stdout)["packages"]
    for (crate, chip), names in CHIPS.items():
        package = next(it for it in packages if it["name"] == crate)
        source = pathlib.Path(package["manifest_path"]).parent / "src" / chip
        periphs = re.findall(r"pub type (\w+) = crate::Periph<(\w+)::RegisterBlock, 0x([0-9a-f_]+)>", (source / "mod.rs").read_text())
        lines = [f"# Written by registers.py from the crate {crate} {package['version']}, MIT or Apache-2.0, https://github.com/stm32-rs/stm32-rs"]
        for name, module, address in periphs:
            if name in names.split():
                found = registers(source / module)
                listed = " ".join(
                    f"{offset:x}={mask:x}" + (f":{value:x}" if value else "") for offset, (mask, value) in sorted(found.items())
                )
                lines.append(f"{name} {address.replace('_', '')} {listed}")
        (FOLDER / f"src/registers/{chip}.txt").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
