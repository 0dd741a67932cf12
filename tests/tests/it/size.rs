//! The documentation prints how much memory the images take, and the limits.

use object::{Object, ObjectSection, ObjectSegment};
use painleve_tests::built_image;
use painleve_tests::printed::{check_row, thousands};

#[test]
fn the_images_take_the_printed_memory() {
    let budget: serde_json::Value =
        serde_json::from_str(include_str!("../../budget.json")).expect("valid JSON");
    let variables = [".data", ".bss", ".uninit"];
    for (name, flash_row, ram_row) in [
        (
            "painleve-f405",
            "flash (code, constants, initial values), STM32F405",
            "static RAM (variables in SRAM2), STM32F405",
        ),
        ("painleve-g474", "flash, STM32G474", "static RAM, STM32G474"),
    ] {
        let bytes = std::fs::read(built_image(name)).unwrap();
        let image = object::File::parse(&*bytes).unwrap();
        let flash_bytes = image.segments().map(|it| it.file_range().1).sum();
        let sections = variables.map(|it| image.section_by_name(it).map_or(0, |it| it.size()));
        let limit = |of: &str| budget["images"][name][of].as_u64().unwrap();
        for (row, bytes, limit) in [
            (flash_row, flash_bytes, limit("flash_bytes")),
            (ram_row, sections.iter().sum(), limit("ram_bytes")),
        ] {
            let [bytes, limit] = [bytes, limit].map(thousands);
            check_row("flashing.md", &format!("| {row} | {bytes} | {limit} |"));
        }
    }
}
