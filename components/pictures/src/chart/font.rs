//! A stroke font for raster pictures: letters as lines on a grid of 5 by 9.

/// Width of a letter with the gap behind it, in units of the grid.
pub(super) const ADVANCE: f64 = 5.6;
/// Row of the baseline, in the same units.
pub(super) const BASE: f64 = 6.0;

/// The strokes of a letter as points of the grid, column from 0 to 4 and row from 0, the top of a capital
/// letter, to 8.
pub(super) fn letter(letter: char) -> impl Iterator<Item = Vec<[f64; 2]>> {
    let point = |digits: &[u8]| [f64::from(digits[0] - b'0'), f64::from(digits[1] - b'0')];
    strokes(letter)
        .split_whitespace()
        .map(move |stroke| stroke.as_bytes().chunks_exact(2).map(point).collect())
}

/// Each stroke is a sequence of points: a digit for the column and one for the row.
#[rustfmt::skip]
fn strokes(letter: char) -> &'static str {
    match letter {
        '0' | 'O' => "103041453616050110", '1' => "112026 1636", '2' => "01103041420646",
        '3' => "01103041423313 334445361605", '4' => "36300444", '5' => "400003334445361605",
        '6' => "4130100105163645443303", '7' => "004026", '8' => "103041423313020110 1304051636454433",
        '9' => "0516364541301001021343",
        'A' => "062046 1434", 'B' => "003041423303 334445360600", 'C' => "4130100105163645",
        'D' => "00204244260600", 'E' => "40000646 0333", 'F' => "400006 0333", 'G' => "41301001051636454323",
        'H' => "0006 4046 0343", 'I' => "1030 2026 1636", 'J' => "4045361605", 'K' => "0006 4003 0346",
        'L' => "000646", 'M' => "0600234046", 'N' => "06004640", 'P' => "06003041423303",
        'Q' => "103041453616050110 2446", 'R' => "06003041423303 2346", 'S' => "413010010213334445361605",
        'T' => "0040 2026", 'U' => "000516364540", 'V' => "002640", 'W' => "0016233640", 'X' => "0046 4006",
        'Y' => "002340 2326", 'Z' => "00400646",
        'a' => "4246 4332120305163645", 'b' => "0006 0312324345361605", 'c' => "4332120305163645",
        'd' => "4046 4332120305163645", 'e' => "04444332120305163645", 'f' => "41302126 1333",
        'g' => "4332120305163645 4247381807", 'h' => "0006 0312324346", 'i' => "2226 2021", 'j' => "22271807 2021",
        'k' => "0006 320436", 'l' => "2026", 'm' => "0602 03122326 23324346", 'n' => "0602 0312324346",
        'o' => "123243453616050312", 'p' => "0208 0312324345361605", 'q' => "4248 4332120305163645",
        'r' => "0602 03123243", 's' => "43321203143445361605", 't' => "20253646 1232", 'u' => "0205163645 4246",
        'v' => "022642", 'w' => "0216243642", 'x' => "0246 4206", 'y' => "0226 421808", 'z' => "02420646",
        '.' => "2526", ',' => "2517", ':' => "2223 2526", ';' => "2223 2517", '-' => "0444", '+' => "2226 0444",
        '_' => "0747", '/' => "0740", '(' => "30212536", ')' => "10212516", '[' => "30101636", ']' => "10303616",
        '=' => "0343 0545", '<' => "410345", '>' => "014305", '*' => "2125 0244 4204", '\'' => "2021",
        '"' => "1011 3031", '^' => "022042", '|' => "2027", '%' => "0640 0010110100 3545463635", '!' => "2024 2526",
        ' ' => "",
        // A box for missing characters.
        _ => "0040460600",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_stay_on_the_grid_with_distinct_strokes() {
        let missing: Vec<Vec<[f64; 2]>> = letter('\u{e000}').collect();
        for each in ' '..='~' {
            let strokes: Vec<Vec<[f64; 2]>> = letter(each).collect();
            assert!(strokes.iter().all(|stroke| stroke.len() >= 2), "{each}");
            assert!(strokes.iter().flatten().all(|[x, y]| *x <= 4.0 && *y <= 8.0), "{each}");
            if each.is_ascii_alphanumeric() || "._-/[]():,".contains(each) {
                assert!(!strokes.is_empty() && strokes != missing, "{each}");
            }
        }
    }
}
