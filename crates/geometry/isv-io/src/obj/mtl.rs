//! MTL, the material libraries of OBJ ("Advanced Visualizer" appendix B5): `Kd` and `map_Kd`.
//!
//! A line that is not understood is passed over, as are alpha (`d`, `Tr`, `map_d`) and everything that is not the diffuse colour.

use crate::text::{self, first_word, parse_float, words};
use isv_volume::Wrap;

/// A material of a library.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Mtl {
    pub(super) name: String,
    /// `Kd`: linear factors of red, green and blue.
    pub(super) diffuse: Option<[f32; 3]>,
    pub(super) map: Option<Map>,
}

/// `map_Kd`: the texture of the diffuse colour, and its options.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Map {
    pub(super) file: String,
    /// `-s`: factors of the coordinates.
    pub(super) scale: [f32; 2],
    /// `-o`: what is added to the scaled coordinates.
    pub(super) offset: [f32; 2],
    /// `-clamp`.
    pub(super) wrap: Wrap,
}

/// Parses a library. Of two materials of one name the first counts, as its users see it first.
pub(super) fn parse(bytes: &[u8]) -> Vec<Mtl> {
    let bytes = &text::decode(bytes);
    let mut materials: Vec<Mtl> = Vec::new();
    for line in text::lines(bytes) {
        let Some((keyword, rest)) = first_word(line) else { continue };
        if keyword.eq_ignore_ascii_case(b"newmtl") {
            materials.push(Mtl { name: name(rest), ..Mtl::default() });
        }
        let Some(material) = materials.last_mut() else { continue };
        if keyword.eq_ignore_ascii_case(b"kd") {
            material.diffuse = diffuse(rest).or(material.diffuse);
        } else if keyword.eq_ignore_ascii_case(b"map_kd") {
            material.map = Map::parse(rest).or(material.map.take());
        }
    }
    materials
}

/// A name, which is all that is left of its line: blanks and `#` belong to it, quotes around it do not.
pub(crate) fn name(rest: &[u8]) -> String {
    let rest = rest.trim_ascii();
    let inner = rest.strip_prefix(b"\"").and_then(|rest| rest.strip_suffix(b"\""));
    String::from_utf8_lossy(inner.unwrap_or(rest)).into_owned()
}

/// The factors of `Kd r g b`; green and blue are red where they are left out. Spectral curves and CIE XYZ are not read.
fn diffuse(rest: &[u8]) -> Option<[f32; 3]> {
    let mut numbers = words(text::without_comment(rest)).map(parse_float);
    let red = numbers.next()??;
    let green = numbers.next().flatten().unwrap_or(red);
    let blue = numbers.next().flatten().unwrap_or(red);
    let factors = [red, green, blue].map(|factor| factor as f32);
    factors.iter().all(|factor| factor.is_finite()).then(|| factors.map(|factor| factor.clamp(0.0, 1.0)))
}

impl Map {
    /// Options and the file's name behind `map_Kd`; `None` without a name.
    fn parse(mut rest: &[u8]) -> Option<Self> {
        let mut map = Self { file: String::new(), scale: [1.0; 2], offset: [0.0; 2], wrap: Wrap::Repeat };
        while let Some((option, after)) = first_word(rest).filter(|(word, _)| word.starts_with(b"-")) {
            let (values, after) = match option {
                b"-o" | b"-s" | b"-t" => numbers(after, 3),
                b"-mm" => numbers(after, 2),
                b"-bm" | b"-boost" => numbers(after, 1),
                b"-clamp" => {
                    let (value, after) = first_word(after)?;
                    map.wrap = if value == b"on" { Wrap::Clamp } else { Wrap::Repeat };
                    (Vec::new(), after)
                }
                b"-blendu" | b"-blendv" | b"-cc" | b"-imfchan" | b"-texres" | b"-type" => {
                    (Vec::new(), first_word(after)?.1)
                }
                // A name that begins with a minus.
                _ => break,
            };
            let target = match option {
                b"-o" => Some(&mut map.offset),
                b"-s" => Some(&mut map.scale),
                _ => None,
            };
            if let Some(target) = target {
                target.iter_mut().zip(values).for_each(|(target, value)| *target = value);
            }
            rest = after;
        }
        map.file = name(rest);
        (!map.file.is_empty()).then_some(map)
    }

    /// A texture coordinate of OBJ, whose v goes up, as one of an image, whose v goes down from the upper left corner.
    pub(super) fn place(&self, [u, v]: [f32; 2]) -> [f32; 2] {
        upside_down([u * self.scale[0] + self.offset[0], v * self.scale[1] + self.offset[1]])
    }
}

/// A texture coordinate with the other direction of v.
pub(super) fn upside_down([u, v]: [f32; 2]) -> [f32; 2] {
    [u, 1.0 - v]
}

/// Up to `most` numbers at the start of a text, and the rest. The last word stays: it is a name.
fn numbers(mut rest: &[u8], most: usize) -> (Vec<f32>, &[u8]) {
    let mut values = Vec::new();
    while let Some((word, after)) = first_word(rest).filter(|(_, after)| !after.is_empty()) {
        let Some(value) = parse_float(word).filter(|_| values.len() < most) else { break };
        values.push(value as f32);
        rest = after;
    }
    (values, rest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn materials_have_names_with_blanks_factors_and_textures() {
        let text = "\u{feff}# a comment\nKd 9 9 9\nnewmtl Material #25\nKd .5 0.25\t1 # grey\nd 0.5\nmap_Kd my skin #1.png\r\n\
                    newmtl \"b\"\nkd spectral file.rfl\nMAP_KD -clamp on -s 2 3 4 -o 0.5 tex\\b.jpg\nKd 0.5\n\
                    newmtl c\nmap_Kd -mm 0 1 -blendu off -bm 0.5 -imfchan m -texres 512 -o 1 2 3 -cc on 7.png\nmap_Kd\nKd nan 0 0";
        let found = parse(text.as_bytes());
        let map =
            |file: &str| Map { file: file.to_owned(), scale: [1.0; 2], offset: [0.0; 2], wrap: Wrap::Repeat };
        assert_eq!(found.len(), 3);
        assert_eq!(found[0].name, "Material #25");
        assert_eq!(
            (found[0].diffuse, found[0].map.clone()),
            (Some([0.5, 0.25, 1.0]), Some(map("my skin #1.png")))
        );
        let clamped = Map { scale: [2.0, 3.0], offset: [0.5, 0.0], wrap: Wrap::Clamp, ..map("tex\\b.jpg") };
        assert_eq!((found[1].name.as_str(), found[1].diffuse), ("b", Some([0.5; 3])));
        assert_eq!(found[1].map, Some(clamped));
        assert_eq!(found[2].map, Some(Map { offset: [1.0, 2.0], ..map("7.png") }));
        assert_eq!(found[2].diffuse, None);
    }

    #[test]
    fn a_number_may_be_a_name() {
        let file = |rest: &str| Map::parse(rest.as_bytes()).map(|map| map.file);
        assert_eq!(file("-s 1 1 1 2"), Some("2".to_owned()));
        assert_eq!(file("-s 1 2"), Some("2".to_owned()));
        assert_eq!(file("-odd.png"), Some("-odd.png".to_owned()));
        assert_eq!(file("-clamp on"), None);
        assert_eq!(file("-clamp"), None);
    }

    #[test]
    fn coordinates_are_turned_upside_down_after_the_options() {
        let map = Map::parse(b"-s 2 4 -o 0.25 0.5 a.png").unwrap();
        assert_eq!(map.place([0.5, 0.125]), [1.25, 0.0]);
    }
}
