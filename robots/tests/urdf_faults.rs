//! Files that do not contain a valid model, and the exact messages.

use std::path::Path;

use motorium_robots::{LoadError, MimicMode, PackagePath, load, parse_urdf};

/// Returns the message for a URDF text, as if it were in `robot.urdf`.
fn fault(text: &str) -> String {
    parse_urdf(text, Some(Path::new("robot.urdf")), MimicMode::Follow, &PackagePath::default())
        .expect_err("the file has a fault")
        .to_string()
}

/// Returns a robot with the links a, b, c and these joints, the first on line 5.
fn joints(joints: &str) -> String {
    format!(
        "<robot name=\"r\">\n<link name=\"a\"/>\n<link name=\"b\"/>\n<link name=\"c\"/>\n{joints}\n</robot>"
    )
}

const B_TO_C: &str = r#"<joint name="bc" type="fixed"><parent link="b"/><child link="c"/></joint>"#;

#[test]
fn malformed_xml_is_rejected_with_line_and_column() {
    assert_eq!(
        fault("<robot name=\"r\">\n  <link name=\"a\">\n</robot>"),
        "robot.urdf:3:1: not well-formed XML: expected 'link' tag, not 'robot'"
    );
    assert_eq!(
        fault("<robot name=\"r\">\n  <link name=\"a\" name=\"b\"/>\n</robot>"),
        "robot.urdf:2:18: not well-formed XML: attribute 'name' is already defined"
    );
    assert!(fault("").starts_with("robot.urdf:1:1: not well-formed XML: "), "{}", fault(""));
}

#[test]
fn file_that_is_not_urdf_reports_its_format() {
    assert_eq!(fault("<mujoco/>"), "robot.urdf:1:1: the root element is <mujoco>, expected <robot>");
    assert_eq!(fault("<robot name=\"r\"/>"), "robot.urdf:1:1: the robot has no <link>");
    let xacro = "<robot name=\"r\" xmlns:xacro=\"http://www.ros.org/wiki/xacro\">\n<xacro:include filename=\"x\"/></robot>";
    assert_eq!(
        fault(xacro),
        "robot.urdf:2:1: this is a xacro file, not yet URDF; expand it first: xacro IN.urdf.xacro > OUT.urdf"
    );
}

#[test]
fn unknown_link_is_named_with_a_suggestion() {
    let text = joints(r#"<joint name="ab" type="fixed"><parent link="a"/><child link="bb"/></joint>"#);
    assert_eq!(
        fault(&text),
        "robot.urdf:5:1: the child link of joint \"ab\" is \"bb\", which does not exist (did you mean \"b\"?)"
    );
    let text = joints(r#"<joint name="ab" type="fixed"><parent link="zzz"/><child link="b"/></joint>"#);
    assert_eq!(
        fault(&text),
        "robot.urdf:5:1: the parent link of joint \"ab\" is \"zzz\", which does not exist"
    );
}

#[test]
fn links_that_are_not_one_tree_are_rejected() {
    assert_eq!(
        fault(&joints(B_TO_C)),
        "robot.urdf:3:1: the robot has 2 root links: a, b; connect them with (fixed) joints"
    );
    let twice = r#"<joint name="ac" type="fixed"><parent link="a"/><child link="c"/></joint>"#;
    assert_eq!(
        fault(&joints(&format!("{B_TO_C}\n{twice}"))),
        "robot.urdf:6:1: link \"c\" is the child of two joints, \"bc\" and \"ac\"; a URDF must be a tree"
    );
    let back = r#"<joint name="cb" type="fixed"><parent link="c"/><child link="b"/></joint>"#;
    assert_eq!(
        fault(&joints(&format!("{B_TO_C}\n{back}"))),
        "robot.urdf:3:1: the links form a loop: b -> c -> b; a URDF must be a tree"
    );
    let own = "<robot name=\"r\"><link name=\"a\"/>\n<joint name=\"aa\" type=\"fixed\"><parent link=\"a\"/><child link=\"a\"/></joint></robot>";
    assert_eq!(fault(own), "robot.urdf:1:17: the links form a loop: a -> a; a URDF must be a tree");
}

#[test]
fn duplicate_name_is_rejected_with_both_lines() {
    let text = "<robot name=\"r\">\n<link name=\"a\"/>\n<link name=\"a\"/>\n</robot>";
    assert_eq!(fault(text), "robot.urdf:3:1: a second link is named \"a\"; the first is at line 2");
    let text = joints(&format!(
        "{}\n{}",
        r#"<joint name="j" type="fixed"><parent link="a"/><child link="b"/></joint>"#,
        r#"<joint name="j" type="fixed"><parent link="b"/><child link="c"/></joint>"#
    ));
    assert_eq!(fault(&text), "robot.urdf:6:1: a second joint is named \"j\"; the first is at line 5");
}

/// Returns the error for a chain a - b - c whose first joint has this type and content; `b` follows on
/// line 6.
fn joint_fault(kind: &str, inside: &str) -> String {
    fault(&joints(&format!(
        "<joint name=\"ab\" type=\"{kind}\"><parent link=\"a\"/><child link=\"b\"/>\n{inside}</joint>\n{B_TO_C}"
    )))
}

#[test]
fn invalid_joints_are_rejected() {
    assert_eq!(
        joint_fault("revolut", ""),
        "robot.urdf:5:1: joint \"ab\" has the unknown type \"revolut\" (did you mean \"revolute\"?)"
    );
    assert_eq!(
        joint_fault("spherical", ""),
        "robot.urdf:5:1: joint \"ab\" is spherical; only revolute, continuous, prismatic, planar and fixed joints are \
         supported, and one floating joint that carries the rest of the robot (model the joint as a chain of these, with \
         massless links in between)"
    );
    let twice = joints(
        "<joint name=\"ab\" type=\"floating\"><parent link=\"a\"/><child link=\"b\"/></joint>\n\
         <joint name=\"bc\" type=\"floating\"><parent link=\"b\"/><child link=\"c\"/></joint>",
    );
    assert!(fault(&twice).contains("joint \"bc\" is floating"));
    assert_eq!(
        joint_fault("revolute", ""),
        "robot.urdf:5:1: joint \"ab\" has no <limit>; a revolute or prismatic joint needs one \
         (an unlimited joint is \"continuous\")"
    );
    assert_eq!(
        joint_fault("revolute", r#"<limit lower="1" upper="-1" velocity="1" effort="1"/>"#),
        "robot.urdf:6:1: joint \"ab\" has its lower limit 1 above its upper limit -1"
    );
    assert_eq!(
        joint_fault("prismatic", r#"<limit lower="0" upper="1" velocity="-2" effort="1"/>"#),
        "robot.urdf:6:1: joint \"ab\" has a negative velocity: -2"
    );
    assert_eq!(
        joint_fault("continuous", r#"<dynamics damping="-2"/>"#),
        "robot.urdf:5:1: joint \"ab\" has a negative damping: -2"
    );
    assert_eq!(
        joint_fault("continuous", r#"<axis xyz="0 0 0"/>"#),
        "robot.urdf:5:1: the axis of joint \"ab\" is zero"
    );
    assert_eq!(
        joint_fault("revolute", r#"<limit lower="0" upper="1" effort="1"/>"#),
        "robot.urdf:6:1: <limit> of <joint name=\"ab\"> has no attribute \"velocity\""
    );
}

#[test]
fn malformed_numbers_are_rejected_with_their_position() {
    assert_eq!(
        joint_fault("fixed", r#"<origin xyz="0 0 1,5"/>"#),
        "robot.urdf:6:1: xyz=\"0 0 1,5\" of <origin> of <joint name=\"ab\">: expected 3 numbers separated by spaces"
    );
    assert_eq!(
        joint_fault("revolute", r#"<limit lower="nan" upper="1" velocity="1" effort="1"/>"#),
        "robot.urdf:6:1: lower=\"nan\" of <limit> of <joint name=\"ab\">: expected a number"
    );
    let text = "<robot name=\"r\"><link name=\"a\"><inertial>\n<mass value=\"inf\"/>\
                <inertia ixx=\"1\" ixy=\"0\" ixz=\"0\" iyy=\"1\" iyz=\"0\" izz=\"1\"/></inertial></link></robot>";
    assert_eq!(
        fault(text),
        "robot.urdf:2:1: value=\"inf\" of <mass> of <link name=\"a\">: expected a number"
    );
}

#[test]
fn missing_or_duplicate_elements_are_rejected() {
    let link = |inside: &str| fault(&format!("<robot name=\"r\">\n<link name=\"a\">{inside}</link></robot>"));
    assert_eq!(
        link("\n<inertial><mass value=\"1\"/></inertial>"),
        "robot.urdf:3:1: <inertial> of <link name=\"a\"> has no <inertia>"
    );
    assert_eq!(
        link("\n<collision><geometry/></collision>"),
        "robot.urdf:3:12: <geometry> of <link name=\"a\"> has no <box>, <cylinder>, <sphere>, <capsule> or <mesh>"
    );
    assert_eq!(
        link("<inertial/>\n<inertial/>"),
        "robot.urdf:3:1: <link name=\"a\"> has more than one <inertial>"
    );
    assert_eq!(
        fault("<robot name=\"r\">\n<link/></robot>"),
        "robot.urdf:2:1: <link> has no attribute \"name\""
    );
    let text = joints(r#"<joint name="ab" type="fixed"><parent link="a"/></joint>"#);
    assert_eq!(fault(&text), "robot.urdf:5:1: <joint name=\"ab\"> has no <child>");
}

#[test]
fn negative_mass_is_rejected() {
    let text = "<robot name=\"r\">\n<link name=\"a\"><inertial><mass value=\"-1\"/>\
                <inertia ixx=\"1\" ixy=\"0\" ixz=\"0\" iyy=\"1\" iyz=\"0\" izz=\"1\"/></inertial></link></robot>";
    assert_eq!(fault(text), "robot.urdf:2:1: link \"a\" has the negative mass -1 kg");
}

/// Returns the error for two continuous joints, `ab` and `bc`, with this content, on lines 5 and 6.
fn mimic_fault(first: &str, second: &str) -> String {
    fault(&joints(&format!(
        "<joint name=\"ab\" type=\"continuous\"><parent link=\"a\"/><child link=\"b\"/>{first}</joint>\n\
         <joint name=\"bc\" type=\"continuous\"><parent link=\"b\"/><child link=\"c\"/>{second}</joint>"
    )))
}

#[test]
fn unresolvable_mimics_are_rejected() {
    assert_eq!(
        mimic_fault("", r#"<mimic joint="abb"/>"#),
        "robot.urdf:6:1: joint \"bc\" mimics \"abb\", which does not exist (did you mean \"ab\"?)"
    );
    assert_eq!(
        mimic_fault(r#"<mimic joint="bc"/>"#, r#"<mimic joint="ab"/>"#),
        "robot.urdf:6:1: the joints mimic each other in a loop: ab -> bc -> ab"
    );
    assert_eq!(
        mimic_fault("", r#"<mimic joint="bc"/>"#),
        "robot.urdf:6:1: the joints mimic each other in a loop: bc -> bc"
    );
    assert_eq!(
        joint_fault("continuous", r#"<mimic joint="bc"/>"#),
        "robot.urdf:5:1: joint \"ab\" mimics \"bc\", which is fixed"
    );
}

#[test]
fn unknown_robot_suggests_the_nearest_catalogue_name() {
    let error = load("pandas", Path::new("/nowhere")).unwrap_err();
    assert_eq!(
        error.to_string(),
        "robot \"pandas\" is neither in the catalogue nor installed, nor a file or folder (/nowhere/pandas does not exist) \
         (did you mean \"panda\"?)"
    );
}

#[test]
fn ambiguous_folder_is_rejected() {
    let folder = tempfile::tempdir().unwrap();
    assert!(matches!(load(".", folder.path()), Err(LoadError::NoUrdf(_))));
    for name in ["x.urdf", "y.urdf"] {
        std::fs::write(folder.path().join(name), "<robot name=\"r\"><link name=\"a\"/></robot>").unwrap();
    }
    let error = load(".", folder.path()).unwrap_err().to_string();
    assert!(error.contains("x.urdf, y.urdf; name one of them"), "{error}");
}

#[test]
fn xacro_is_recognised_in_every_form() {
    let link = "<link name=\"a\"/>";
    for (text, line) in [
        ("<robot name=\"r\" xmlns:xacro=\"http://ros.org/wiki/xacro\">\n<xacro:arm/></robot>".to_owned(), 2),
        // The prefix is not declared.
        ("<robot name=\"r\">\n<xacro:arm/></robot>".to_owned(), 2),
        // expressions and substitutions without a xacro element
        (
            format!(
                "<robot name=\"r\">{link}\n<link name=\"b\"><inertial><mass value=\"${{m}}\"/></inertial></link></robot>"
            ),
            2,
        ),
        (format!("<robot name=\"r\">{link}\n\n<link name=\"$(arg prefix)b\"/></robot>"), 3),
    ] {
        let error = parse_urdf(&text, None, MimicMode::Follow, &PackagePath::default()).unwrap_err();
        assert!(error.to_string().contains("this is a xacro file, not yet URDF"), "{error}");
        assert_eq!(error.at.unwrap().line, line, "{error}");
    }
}

#[test]
fn mimics_of_floating_and_planar_joints_are_rejected() {
    for (leader, follower) in [("floating", "continuous"), ("planar", "continuous"), ("planar", "planar")] {
        let text = joints(&format!(
            "<joint name=\"ab\" type=\"{leader}\"><parent link=\"a\"/><child link=\"b\"/></joint>\n\
             <joint name=\"bc\" type=\"{follower}\"><parent link=\"b\"/><child link=\"c\"/><mimic joint=\"ab\"/></joint>"
        ));
        assert_eq!(
            fault(&text),
            format!(
                "robot.urdf:6:1: joint \"bc\" mimics \"ab\", which is {leader} and has no single position; expected a \
                 revolute, continuous or prismatic joint"
            )
        );
    }
}

#[test]
fn floating_joint_that_mimics_is_rejected() {
    let text = joints(
        "<joint name=\"ab\" type=\"floating\"><parent link=\"a\"/><child link=\"b\"/><mimic joint=\"bc\"/></joint>\n\
         <joint name=\"bc\" type=\"continuous\"><parent link=\"b\"/><child link=\"c\"/></joint>",
    );
    assert!(
        fault(&text).starts_with("robot.urdf:5:1: joint \"ab\" is a floating mimic joint; "),
        "{}",
        fault(&text)
    );
}
