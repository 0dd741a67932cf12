//! Colours for dark screens, computed from those for white paper.
//!
//! In the OKLab colour space (Ottosson 2020), whose lightness is the perceived one, pale colours and
//! greys exchange light and dark; strong colours keep their hue and are at least light enough to be
//! seen on the dark ground.

use crate::style::Colour;

/// Lightness of the dark ground.
const GROUND: f64 = 0.20;
/// How much lighter a grey gets for each step that it is darker on paper.
const SLOPE: f64 = 0.94;
/// Chroma above which a colour is strong.
const STRONG: f64 = 0.09;
/// Least lightness of a strong colour.
const LEAST_STRONG: f64 = 0.64;

/// Returns the counterpart of a colour on a dark ground.
pub fn of(colour: Colour) -> Colour {
    let [lightness, a, b] = to_oklab(colour);
    if a.hypot(b) > STRONG {
        return from_oklab([lightness.max(LEAST_STRONG), a, b]);
    }
    from_oklab([GROUND + SLOPE * (1.0 - lightness), a, b])
}

fn to_oklab(Colour(red, green, blue): Colour) -> [f64; 3] {
    let linear = |part: u8| {
        let part = f64::from(part) / 255.0;
        if part <= 0.04045 {
            part / 12.92
        } else {
            ((part + 0.055) / 1.055).powf(2.4)
        }
    };
    let [r, g, b] = [red, green, blue].map(linear);
    let l = (0.4122214708 * r + 0.5363325363 * g + 0.0514459929 * b).cbrt();
    let m = (0.2119034982 * r + 0.6806995451 * g + 0.1073969566 * b).cbrt();
    let s = (0.0883024619 * r + 0.2817188376 * g + 0.6299787005 * b).cbrt();
    [
        0.2104542553 * l + 0.7936177850 * m - 0.0040720468 * s,
        1.9779984951 * l - 2.4285922050 * m + 0.4505937099 * s,
        0.0259040371 * l + 0.7827717662 * m - 0.8086757660 * s,
    ]
}

fn from_oklab([lightness, a, b]: [f64; 3]) -> Colour {
    let l = (lightness + 0.3963377774 * a + 0.2158037573 * b).powi(3);
    let m = (lightness - 0.1055613458 * a - 0.0638541728 * b).powi(3);
    let s = (lightness - 0.0894841775 * a - 1.2914855480 * b).powi(3);
    let part = |linear: f64| {
        let part = if linear <= 0.0031308 {
            12.92 * linear
        } else {
            1.055 * linear.powf(1.0 / 2.4) - 0.055
        };
        (255.0 * part.clamp(0.0, 1.0)).round() as u8
    };
    Colour(
        part(4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s),
        part(-1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s),
        part(-0.0041960863 * l - 0.7034186147 * m + 1.7076147010 * s),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::style::{BLACK_INK, BLUE_INK, GREEN, GREY, ORANGE, SKY, VERMILLION, WHITE};

    #[test]
    fn a_colour_survives_the_way_there_and_back() {
        for colour in [BLACK_INK, WHITE, BLUE_INK, Colour(255, 0, 0)] {
            assert_eq!(from_oklab(to_oklab(colour)), colour);
        }
    }

    #[test]
    fn every_colour_is_distinct_from_the_dark_ground() {
        // Relative luminance and contrast as in WCAG 2; 3 : 1 is its bar for graphics.
        let luminance = |Colour(r, g, b): Colour| {
            let linear = |part: u8| (f64::from(part) / 255.0).powf(2.2);
            0.2126 * linear(r) + 0.7152 * linear(g) + 0.0722 * linear(b)
        };
        let ground = luminance(of(WHITE));
        for colour in [BLACK_INK, GREY, BLUE_INK, SKY, GREEN, ORANGE, VERMILLION] {
            let contrast = (luminance(of(colour)) + 0.05) / (ground + 0.05);
            assert!(contrast > 3.0, "{colour:?}: {contrast}");
        }
    }
}
