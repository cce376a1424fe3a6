package vantage.spy;

import java.awt.Color;
import java.awt.Dimension;
import java.awt.Graphics;
import java.awt.Graphics2D;
import java.awt.Point;
import java.awt.RenderingHints;
import java.awt.event.MouseAdapter;
import java.awt.event.MouseEvent;
import java.awt.image.BufferedImage;
import javax.swing.JPanel;
import vantage.completeness_t;
import vantage.viewpoint_t;

/** How well an object is known from every direction: red never detected, green always; white dots are learned views. */
final class SpherePanel extends JPanel {
    private completeness_t known; // null: nothing heard yet.
    private double azimuth = 0.6, elevation = 0.5; // From where the sphere is looked at, radians, object frame.
    private Point grabbed;

    SpherePanel() {
        setPreferredSize(new Dimension(320, 320));
        setBackground(new Color(30, 30, 34));
        MouseAdapter turn = new MouseAdapter() {
            @Override public void mousePressed(MouseEvent event) { grabbed = event.getPoint(); }
            @Override public void mouseDragged(MouseEvent event) {
                azimuth -= 0.01 * (event.getX() - grabbed.x);
                elevation = Math.max(-1.5, Math.min(1.5, elevation + 0.01 * (event.getY() - grabbed.y)));
                grabbed = event.getPoint();
                repaint();
            }
        };
        addMouseListener(turn);
        addMouseMotionListener(turn);
    }

    void show(completeness_t message) {
        known = message;
        repaint();
    }

    /** Unit vectors in the object's frame: towards the eye, to the right and up in the picture. */
    private double[][] axes() {
        double[] eye = {Math.cos(elevation) * Math.cos(azimuth), Math.cos(elevation) * Math.sin(azimuth), Math.sin(elevation)};
        double[] right = {-Math.sin(azimuth), Math.cos(azimuth), 0};
        double[] up = {eye[1] * right[2] - eye[2] * right[1], eye[2] * right[0] - eye[0] * right[2], eye[0] * right[1] - eye[1] * right[0]};
        return new double[][] {eye, right, up};
    }

    private static double dot(double[] a, double[] b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

    @Override protected void paintComponent(Graphics graphics) {
        super.paintComponent(graphics);
        Graphics2D paper = (Graphics2D) graphics;
        paper.setRenderingHint(RenderingHints.KEY_ANTIALIASING, RenderingHints.VALUE_ANTIALIAS_ON);
        if (known == null) {
            paper.setColor(Color.LIGHT_GRAY);
            paper.drawString("no ASSESSOR_COMPLETENESS yet", 12, 20);
            return;
        }
        int radius = Math.max(10, Math.min(getWidth(), getHeight() - 30) / 2 - 8);
        int centre_x = getWidth() / 2, centre_y = 26 + radius;
        paper.drawImage(ball(radius), centre_x - radius, centre_y - radius, null);
        double[][] axes = axes();
        for (viewpoint_t view : known.viewpoints) {
            if (dot(view.direction, axes[0]) < 0) continue; // On the far side.
            int x = centre_x + (int) Math.round(radius * dot(view.direction, axes[1]));
            int y = centre_y - (int) Math.round(radius * dot(view.direction, axes[2]));
            paper.setColor(Color.BLACK);
            paper.fillOval(x - 5, y - 5, 10, 10);
            paper.setColor(Color.WHITE);
            paper.fillOval(x - 4, y - 4, 8, 8);
        }
        paper.setColor(Color.WHITE);
        paper.drawString(String.format("%s: %.0f %% known, %d views (%s)", known.object, 100 * known.completeness, known.views, known.rule), 8, 16);
    }

    private BufferedImage ball(int radius) {
        double[][] axes = axes();
        BufferedImage image = new BufferedImage(2 * radius, 2 * radius, BufferedImage.TYPE_INT_ARGB);
        for (int y = 0; y < 2 * radius; ++y) {
            for (int x = 0; x < 2 * radius; ++x) {
                double right = (x + 0.5) / radius - 1, up = 1 - (y + 0.5) / radius, rest = 1 - right * right - up * up;
                if (rest < 0) continue;
                double near = Math.sqrt(rest);
                double[] direction = new double[3];
                for (int i = 0; i < 3; ++i) direction[i] = near * axes[0][i] + right * axes[1][i] + up * axes[2][i];
                double light = 0.45 + 0.55 * near;
                image.setRGB(x, y, Color.HSBtoRGB((float) (0.33 * probability(direction)), 0.75f, (float) (0.95 * light)));
            }
        }
        return image;
    }

    /** Of the cell in this direction, within [0, 1]. */
    private double probability(double[] direction) {
        if (known.azimuth_cells < 1 || known.elevation_cells < 1) return 0;
        double around = (Math.atan2(direction[1], direction[0]) + Math.PI) / (2 * Math.PI);
        double above = Math.asin(Math.max(-1, Math.min(1, direction[2]))) / Math.PI + 0.5;
        int column = Math.min(known.azimuth_cells - 1, (int) (around * known.azimuth_cells));
        int row = Math.min(known.elevation_cells - 1, (int) (above * known.elevation_cells));
        return Math.max(0, Math.min(1, known.cells[row][column]));
    }
}
