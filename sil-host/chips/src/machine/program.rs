//! An image as a programmer writes it to the flash.

use std::path::Path;

use object::{Object, ObjectSegment, ObjectSymbol};

use super::Chip;

/// Content of the flash, and what is known about it.
pub(super) struct Program {
    /// Bytes of the flash.
    pub flash: Vec<u8>,
    /// The program that the image copies to the RAM at address 0.
    pub in_ram: Vec<u8>,
    /// Names and addresses.
    pub symbols: Vec<(String, u32)>,
}

impl Program {
    /// Reads an ELF file.
    ///
    /// # Panics
    /// If there is none.
    pub fn read<C: Chip>(image: &Path) -> Self {
        let file = std::fs::read(image)
            .unwrap_or_else(|error| panic!("no image at {}: {error}", image.display()));
        let elf = object::File::parse(&*file).unwrap_or_else(|error| panic!("{error}"));
        let mut flash = vec![0xff; C::FLASH.1];
        let mut in_ram = vec![0; C::ALIASED_RAM];
        for segment in elf.segments() {
            let bytes = segment.data().unwrap_or_default();
            let at = segment.address() as usize;
            if let Some(place) = in_ram.get_mut(at..at + bytes.len()) {
                place.copy_from_slice(bytes);
            }
            // Initial values are in flash, after the code; the image copies them.
            let at = physical_address(&elf, &segment).wrapping_sub(u64::from(C::FLASH.0)) as usize;
            if let Some(place) = flash.get_mut(at..at + bytes.len()) {
                place.copy_from_slice(bytes);
            }
        }
        let symbols = elf
            .symbols()
            .filter_map(|it| Some((it.name().ok()?.to_owned(), it.address() as u32)))
            .collect();
        Self {
            flash,
            in_ram,
            symbols,
        }
    }
}

/// Returns the physical address of a segment.
fn physical_address(elf: &object::File<'_>, segment: &object::Segment<'_, '_>) -> u64 {
    use object::read::elf::ProgramHeader;
    let object::File::Elf32(file) = elf else {
        return segment.address();
    };
    let endian = file.endian();
    let headers = file.elf_program_headers().iter();
    let same = |it: &&object::elf::ProgramHeader32<object::Endianness>| {
        u64::from(it.p_vaddr(endian)) == segment.address()
            && (
                u64::from(it.p_offset(endian)),
                u64::from(it.p_filesz(endian)),
            ) == segment.file_range()
    };
    let mut found = headers.filter(same);
    found
        .next()
        .map_or(segment.address(), |it| it.p_paddr(endian).into())
}
