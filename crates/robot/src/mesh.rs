//! The triangles of meshes: STL, text or binary, and OBJ.

/// Three corners.
pub type Triangle = [[f64; 3]; 3];

/// The triangles of a mesh, as its file has them; `None` if it is of another kind, broken or empty.
pub fn triangles(content: &[u8]) -> Option<Vec<Triangle>> {
    let triangles = binary(content).or_else(|| text(std::str::from_utf8(content).ok()?))?;
    let is_sound = !triangles.is_empty() && triangles.iter().flatten().flatten().all(|number| number.is_finite());
    is_sound.then_some(triangles)
}

/// Of a binary STL: 80 bytes, the number of triangles, and 50 bytes for each, a normal and three corners first.
fn binary(content: &[u8]) -> Option<Vec<Triangle>> {
    const HEAD: usize = 84;
    const TRIANGLE: usize = 50;
    let count = u32::from_le_bytes(content.get(80..HEAD)?.try_into().ok()?);
    let triangles = content.get(HEAD..)?;
    if triangles.len() != usize::try_from(count).ok()?.checked_mul(TRIANGLE)? {
        return None;
    }
    let number = |bytes: &[u8]| bytes.try_into().map_or(f64::NAN, |bytes| f64::from(f32::from_le_bytes(bytes)));
    let corner = |bytes: &[u8]| [0, 4, 8].map(|at| number(&bytes[at..at + 4]));
    let triangle = |bytes: &[u8]| [12, 24, 36].map(|at| corner(&bytes[at..at + 12]));
    Some(triangles.chunks_exact(TRIANGLE).map(triangle).collect())
}

/// Of an STL in letters, with three lines `vertex x y z` for each, or an OBJ: `v x y z` for each corner and `f a b c …` for each side, with
/// the numbers of its corners (`a/b/c` begins with one), counted from 1, or from the last one backwards.
fn text(content: &str) -> Option<Vec<Triangle>> {
    let (mut corners, mut triangles) = (Vec::new(), Vec::new());
    for line in content.lines() {
        let mut words = line.split_whitespace();
        let word = words.next().unwrap_or_default();
        match word {
            "v" | "vertex" => {
                let mut number = || words.next()?.parse::<f64>().ok();
                corners.push([number()?, number()?, number()?]);
                if let (true, [a, b, c]) = (word == "vertex", &corners[..]) {
                    triangles.push([*a, *b, *c]);
                    corners.clear();
                }
            }
            "f" => {
                let corner = |word: &str| {
                    let number: isize = word.split('/').next()?.parse().ok()?;
                    let back = corners.len().checked_sub(number.unsigned_abs());
                    corners.get(if number < 0 { back? } else { number.unsigned_abs().checked_sub(1)? }).copied()
                };
                let side = words.map(corner).collect::<Option<Vec<_>>>()?;
                let first = side.first()?;
                triangles.extend(side[1..].windows(2).map(|pair| [*first, pair[0], pair[1]]));
            }
            _ => {}
        }
    }
    Some(triangles)
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNERS: Triangle = [[0.0, 0.5, 1.0], [0.25, -2.0, 0.0], [1.0, 0.0, 8.0]];

    #[test]
    fn three_kinds_of_files_have_the_same_triangles() {
        let mut stl = vec![b' '; 80];
        stl.extend(1_u32.to_le_bytes());
        let numbers = [[0.0; 3]].iter().chain(&CORNERS).flatten().flat_map(|number| (*number as f32).to_le_bytes());
        stl.extend(numbers.chain([0, 0]).collect::<Vec<u8>>());
        let written = |word: &str| CORNERS.map(|[x, y, z]| format!("  {word} {x} {y} {z}\n")).concat();
        let letters =
            format!("solid a\nfacet normal 0 0 1\nouter loop\n{}endloop\nendfacet\nendsolid a\n", written("vertex"));
        let obj = format!("# a\no a\n{}vn 0 0 1\nf 1/1/1 2//1 3\n", written("v"));
        let backwards = obj.replace("f 1/1/1 2//1 3", "f -3 -2 -1");
        for content in [&stl[..], letters.as_bytes(), obj.as_bytes(), backwards.as_bytes()] {
            assert_eq!(triangles(content).as_deref(), Some(&[CORNERS][..]));
        }
        let square = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n";
        assert_eq!(triangles(square).map(|it| it.len()), Some(2));
        let broken =
            [&stl[..stl.len() - 1], b"", b"glTF", b"v 1 2\n", b"v nan 0 0\nf 1 1 1\n", b"f 1 2 3\n", &[255; 200]];
        for broken in broken {
            assert_eq!(triangles(broken), None, "{broken:?}");
        }
        for broken in ["f 0 1 2", "f -9 1 2", "f 1 2 99999999999999999999", "f", "f -9223372036854775808"] {
            assert_eq!(triangles(format!("{obj}{broken}\n").as_bytes()), None, "{broken}");
        }
    }
}
