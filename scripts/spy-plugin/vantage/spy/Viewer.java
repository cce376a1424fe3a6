package vantage.spy;

import java.awt.Color;
import java.awt.Dimension;
import java.awt.FlowLayout;
import java.awt.Graphics;
import java.awt.image.BufferedImage;
import java.io.IOException;
import javax.swing.JFrame;
import javax.swing.JPanel;
import javax.swing.SwingUtilities;
import javax.swing.WindowConstants;
import lcm.lcm.LCM;
import lcm.lcm.LCMDataInputStream;
import lcm.lcm.LCMSubscriber;
import vantage.completeness_t;
import vantage.image_part_t;

/** One window with what the camera sees, how far it is, and how well the object is known. There is one at most. */
final class Viewer implements LCMSubscriber {
    private static Viewer shown;

    private final JFrame frame = new JFrame("Vantage");
    private final ImagePanel color = new ImagePanel("SENSOR_COLOR");
    private final ImagePanel depth = new ImagePanel("SENSOR_DEPTH");
    private final SpherePanel sphere = new SpherePanel();
    private final ImageParts color_parts = new ImageParts();
    private final ImageParts depth_parts = new ImageParts();

    static synchronized void open() {
        if (shown == null) shown = new Viewer();
        shown.frame.setVisible(true);
        shown.frame.toFront();
    }

    private Viewer() {
        JPanel all = new JPanel(new FlowLayout(FlowLayout.CENTER, 6, 6));
        all.setBackground(new Color(30, 30, 34));
        all.add(color);
        all.add(depth);
        all.add(sphere);
        frame.setContentPane(all);
        frame.setDefaultCloseOperation(WindowConstants.HIDE_ON_CLOSE);
        frame.setSize(1010, 380);
        frame.setLocation(0, 320);
        LCM bus = LCM.getSingleton();
        for (String channel : new String[] {"SENSOR_COLOR", "SENSOR_DEPTH", "ASSESSOR_COMPLETENESS"}) bus.subscribe(channel, this);
    }

    /** From LCM's thread. What cannot be read is said under the picture, and the next message is waited for. */
    @Override public void messageReceived(LCM bus, String channel, LCMDataInputStream data) {
        if (!frame.isVisible()) return;
        ImagePanel panel = channel.equals("SENSOR_COLOR") ? color : depth;
        try {
            if (channel.equals("ASSESSOR_COMPLETENESS")) {
                completeness_t message = new completeness_t(data);
                SwingUtilities.invokeLater(() -> sphere.show(message));
                return;
            }
            image_part_t part = new image_part_t(data);
            BufferedImage image = (panel == color ? color_parts : depth_parts).add(part);
            if (image != null) SwingUtilities.invokeLater(() -> panel.show(image, part.frame_id));
        } catch (IOException | RuntimeException error) {
            SwingUtilities.invokeLater(() -> panel.complain(error.getMessage()));
        }
    }

    private static final class ImagePanel extends JPanel {
        private final String name;
        private BufferedImage image;
        private String text = "nothing yet";

        ImagePanel(String name) {
            this.name = name;
            setPreferredSize(new Dimension(320, 320));
            setBackground(new Color(30, 30, 34));
        }

        void show(BufferedImage newest, long frame_id) {
            image = newest;
            text = newest.getWidth() + "x" + newest.getHeight() + ", frame " + frame_id;
            repaint();
        }

        void complain(String why) {
            text = why;
            repaint();
        }

        @Override protected void paintComponent(Graphics graphics) {
            super.paintComponent(graphics);
            graphics.setColor(Color.WHITE);
            graphics.drawString(name + ": " + text, 4, 16);
            if (image == null) return;
            double scale = Math.min((double) getWidth() / image.getWidth(), (double) (getHeight() - 26) / image.getHeight());
            graphics.drawImage(image, 0, 26, (int) (scale * image.getWidth()), (int) (scale * image.getHeight()), null);
        }
    }
}
