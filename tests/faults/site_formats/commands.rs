//! Commands of Radiance scenes.

use super::*;

#[test]
fn commands_are_executed_or_refused_by_name() {
    let files = Files::new();
    files.write(
        "tree.rad",
        "void plastic leaf 0 0 5 .1 .3 .1 0 0\nleaf polygon top 0 0 9 0 0 2 1 0 2 0 1 2\n",
    );
    files.write("house.obj", OBJ.replace("mtllib", "#"));
    let text = "\
void plastic red 0 0 5 .5 .1 .1 0 0
!xform -n wood -a 10 -t 3 0 0 -a 5 -t 0 3 0 tree.rad   # fifty
!xform -n more -t 100 0 0 \\
  -rz 90 tree.rad | xform -m red
red mesh block 8 house.obj -t 0 0 20 -s 2 -mx 0 0
void mesh plain 1 house.obj 0 0
";
    let site = files.site("scene.rad", text, None);
    assert_eq!(site.faces.len(), 50 + 1 + 4 + 4);
    assert_eq!(site.objects[49].id, "wood.9.4.top");
    let modifier = |face: usize| &site.materials[site.faces[face].material as usize].name;
    assert_eq!((modifier(0).as_str(), modifier(50).as_str()), ("leaf", "red"));
    assert_eq!(modifier(51), "red");
    assert_eq!(modifier(58), "glazed");
    assert_eq!(site.bounds.max.z, 50.0);
    for (text, words) in [
        (
            "!xform -a 1000 -a 1000 -t 1 0 0 tree.rad\n",
            &["s.rad:1:1", "1000000 copies", "100000 at most"][..],
        ),
        ("\n!genbox red b 1 2 3\n", &["s.rad:2:1", "`genbox` isn't run"]),
        ("!cat s.rad\n", &["include each other", "24 deep"]),
        ("!xform -t 1 2 nothing.rad\n", &["s.rad:1:1", "expected a number after -t"]),
        ("!cat /dev/zero\n", &["no ordinary file"]),
        ("!rm -rf x; true\n", &["`;` needs a shell"]),
        ("x mesh m 1 m.rtm 0 0\n", &["s.rad:1:1 (m)", "`m.rtm`", "name the .obj"]),
        ("x instance i 1 i.oct 0 0\n", &["`i.oct`", "octrees aren't read"]),
    ] {
        says(&files.refusal("s.rad", text), words);
    }
    // Copies of copies of copies end by their number, not by the clock.
    let start = cpu_time();
    files.write("a.rad", "!xform -a 100000 -t 0 0 0 b.rad\n");
    files.write("b.rad", "!xform -a 100000 -t 0 0 0 tree.rad\n");
    says(&files.refusal("s.rad", "!cat a.rad\n"), &["bytes of text"]);
    assert!(cpu_time() - start < Duration::from_secs(60));
}
