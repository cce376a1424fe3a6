"""Shows that check_includes.py catches what it is there to catch."""
import pathlib
import tempfile
import unittest

import check_includes

LAYERS = check_includes.read_layers("geometry: \nrgbd: geometry\nfeatures: rgbd\nmotion: geometry\nmessaging: features motion\n")


class IncludeRules(unittest.TestCase):
    def found(self, file, text):
        """Problems where lib/FILE holds the text and every module exists."""
        with tempfile.TemporaryDirectory() as folder:
            lib = pathlib.Path(folder)
            for module in LAYERS:
                (lib / module).mkdir()
            path = lib / file
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
            return list(check_includes.problems(lib, LAYERS))

    def test_arrows_allow_themselves_and_what_they_lead_to(self):
        text = '#include "features/x.h"\n#include "rgbd/frame.h"\n  #  include "geometry/rigid.h"\n#include <vector>\n'
        self.assertEqual(self.found("features/x.cpp", text), [])

    def test_wrong_way_is_caught_with_file_and_line(self):
        problems = self.found("geometry/rigid.h", '// Poses.\n#include "rgbd/frame.h"\n')
        self.assertEqual(len(problems), 1)
        self.assertIn("rigid.h:2: geometry may not include rgbd/frame.h", problems[0])

    def test_sideways_is_caught(self):
        self.assertEqual(len(self.found("motion/x.cpp", '#include "rgbd/frame.h"\n')), 1)

    def test_only_messaging_knows_lcm(self):
        for text in ("#include <lcm/lcm-cpp.hpp>\n", '#include "lcm/lcm.h"\n', '#include "vantage/vantage_status_t.hpp"\n'):
            self.assertEqual(len(self.found("motion/x.cpp", text)), 1, text)
            self.assertEqual(self.found("messaging/x.cpp", text), [])

    def test_nobody_includes_messaging(self):
        self.assertEqual(len(self.found("features/x.cpp", '#include "messaging/channels.h"\n')), 1)

    def test_a_module_without_arrows_is_caught(self):
        self.assertEqual(len(self.found("novel/x.cpp", "int x;\n")), 1)

    def test_nested_files_are_read(self):
        self.assertEqual(len(self.found("geometry/detail/x.cpp", '#include "rgbd/frame.h"\n')), 1)


if __name__ == "__main__":
    unittest.main()
