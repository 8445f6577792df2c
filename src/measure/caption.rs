//! Words in a picture of pixels, from letters of three by five.

use image::{Rgba, RgbaImage};

/// Rows of a letter from the top, three bits each, for what [`LETTERS`] lists.
const ROWS: [[u8; 5]; 40] = [
    [2, 5, 7, 5, 5],
    [6, 5, 6, 5, 6],
    [3, 4, 4, 4, 3],
    [6, 5, 5, 5, 6],
    [7, 4, 6, 4, 7],
    [7, 4, 6, 4, 4],
    [3, 4, 5, 5, 3],
    [5, 5, 7, 5, 5],
    [7, 2, 2, 2, 7],
    [1, 1, 1, 5, 2],
    [5, 5, 6, 5, 5],
    [4, 4, 4, 4, 7],
    [5, 7, 7, 5, 5],
    [6, 5, 5, 5, 5],
    [2, 5, 5, 5, 2],
    [6, 5, 6, 4, 4],
    [2, 5, 5, 6, 3],
    [6, 5, 6, 5, 5],
    [3, 4, 2, 1, 6],
    [7, 2, 2, 2, 2],
    [5, 5, 5, 5, 7],
    [5, 5, 5, 5, 2],
    [5, 5, 7, 7, 5],
    [5, 5, 2, 5, 5],
    [5, 5, 2, 2, 2],
    [7, 1, 2, 4, 7],
    [7, 5, 5, 5, 7],
    [2, 6, 2, 2, 7],
    [6, 1, 2, 4, 7],
    [6, 1, 2, 1, 6],
    [5, 5, 7, 1, 1],
    [7, 4, 6, 1, 6],
    [3, 4, 7, 5, 7],
    [7, 1, 2, 2, 2],
    [7, 5, 7, 5, 7],
    [7, 5, 7, 1, 6],
    [5, 1, 2, 4, 5],
    [0, 0, 0, 0, 2],
    [0, 0, 7, 0, 0],
    [0, 0, 0, 0, 0],
];
const LETTERS: &str = "ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789%.- ";

/// Writes `text` with its upper left corner at `(x, y)`, `scale` pixels to a dot. Letters are shown as capitals;
/// what has no letter here is a blank. What lies outside the picture is not drawn.
pub fn write(picture: &mut RgbaImage, (x, y): (u32, u32), scale: u32, text: &str, color: Rgba<u8>) {
    for (place, letter) in text.to_uppercase().chars().enumerate() {
        let index = LETTERS.chars().position(|known| known == letter);
        let rows = ROWS[index.unwrap_or(ROWS.len() - 1)];
        for (row, bits) in rows.into_iter().enumerate() {
            for column in (0..3).filter(|column| bits >> (2 - column) & 1 == 1) {
                let left = x + scale * (4 * place as u32 + column);
                let top = y + scale * row as u32;
                for (dx, dy) in (0..scale).flat_map(|dx| (0..scale).map(move |dy| (dx, dy))) {
                    if let Some(pixel) = picture.get_pixel_mut_checked(left + dx, top + dy) {
                        *pixel = color;
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_stand_where_they_are_told_and_stop_at_the_edge() {
        let white = Rgba([255; 4]);
        let mut picture = RgbaImage::new(16, 12);
        write(&mut picture, (1, 1), 2, "l!t", white);
        let row = |y: u32| -> String {
            (0..16)
                .map(|x| {
                    if *picture.get_pixel(x, y) == white {
                        '#'
                    } else {
                        '.'
                    }
                })
                .collect()
        };
        assert_eq!(row(0), "................");
        assert_eq!(row(2), ".##.............");
        assert_eq!(row(10), ".######.........");
        assert_eq!(ROWS.len(), LETTERS.chars().count());
    }
}
