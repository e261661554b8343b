"""Dormand-Prince 8(5,3) of E. Hairer, local extrapolation, first same as last, interpolant of order 7.

E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I, II.5, II.6 and II.10, and the program
DOP853 that goes with it: its numbers, to the last bit of a double, under its names (A1210: stage 12, slope 10).
"""

from math import sqrt

STAGES = 12  # right-hand sides a step; the last is the first of the next step
EXTRA = 3  # right-hand sides that the interpolant needs on top
POWER, SAFETY, SHRINK, GROW = 1.0 / 8.0, 0.9, 1.0 / 3.0, 6.0

C2, C3, C4, C5, C6 = 0.05260015195876773, 0.0789002279381516, 0.1183503419072274, 0.2816496580927726, 0.3333333333333333
C7, C8, C9, C10, C11 = 0.25, 0.3076923076923077, 0.6512820512820513, 0.6, 0.8571428571428571
C14, C15, C16 = 0.1, 0.2, 0.7777777777777778
A21 = 0.05260015195876773
A31, A32 = 0.0197250569845379, 0.0591751709536137
A41, A43 = 0.02958758547680685, 0.08876275643042054
A51, A53, A54 = 0.2413651341592667, -0.8845494793282861, 0.924834003261792
A61, A64, A65 = 0.037037037037037035, 0.17082860872947386, 0.12546768756682242
A71, A74, A75, A76 = 0.037109375, 0.17025221101954405, 0.06021653898045596, -0.017578125
A81, A84, A85, A86 = 0.03709200011850479, 0.17038392571223998, 0.10726203044637328, -0.015319437748624402
A87 = 0.008273789163814023
A91, A94, A95, A96 = 0.6241109587160757, -3.3608926294469414, -0.868219346841726, 27.59209969944671
A97, A98 = 20.154067550477894, -43.48988418106996
A101, A104, A105, A106 = 0.47766253643826434, -2.4881146199716677, -0.590290826836843, 21.230051448181193
A107, A108, A109 = 15.279233632882423, -33.28821096898486, -0.020331201708508627
A111, A114, A115, A116 = -0.9371424300859873, 5.186372428844064, 1.0914373489967295, -8.149787010746927
A117, A118, A119, A1110 = -18.52006565999696, 22.739487099350505, 2.4936055526796523, -3.0467644718982196
A121, A124, A125, A126 = 2.273310147516538, -10.53449546673725, -2.0008720582248625, -17.9589318631188
A127, A128, A129, A1210 = 27.94888452941996, -2.8589982771350235, -8.87285693353063, 12.360567175794303
A1211 = 0.6433927460157636
B1, B6, B7, B8 = 0.054293734116568765, 4.450312892752409, 1.8915178993145003, -5.801203960010585
B9, B10, B11, B12 = 0.3111643669578199, -0.1521609496625161, 0.20136540080403034, 0.04471061572777259
BHH1, BHH2, BHH3 = 0.24409448818897638, 0.7338466882816118, 0.022058823529411766
ER1, ER6, ER7, ER8 = 0.01312004499419488, -1.2251564463762044, -0.4957589496572502, 1.6643771824549864
ER9, ER10, ER11, ER12 = -0.35032884874997366, 0.3341791187130175, 0.08192320648511571, -0.022355307863886294
A141, A147, A148, A149 = 0.056167502283047954, 0.25350021021662483, -0.2462390374708025, -0.12419142326381637
A1410, A1411, A1412, A1413 = 0.15329179827876568, 0.00820105229563469, 0.007567897660545699, -0.008298
A151, A156, A157, A158 = 0.03183464816350214, 0.028300909672366776, 0.053541988307438566, -0.05492374857139099
A1511, A1512, A1513, A1514 = -0.00010834732869724932, 0.0003825710908356584, -0.00034046500868740456, 0.1413124436746325
A161, A166, A167, A168 = -0.42889630158379194, -4.697621415361164, 7.683421196062599, 4.06898981839711
A169, A1613, A1614, A1615 = 0.3567271874552811, -0.0013990241651590145, 2.9475147891527724, -9.15095847217987
D41, D46, D47, D48 = -8.428938276109013, 0.5667149535193777, -3.0689499459498917, 2.38466765651207
D49, D410, D411, D412 = 2.117034582445028, -0.871391583777973, 2.2404374302607883, 0.6315787787694688
D413, D414, D415, D416 = -0.08899033645133331, 18.148505520854727, -9.194632392478356, -4.436036387594894
D51, D56, D57, D58 = 10.427508642579134, 242.28349177525817, 165.20045171727028, -374.5467547226902
D59, D510, D511, D512 = -22.113666853125306, 7.733432668472264, -30.674084731089398, -9.332130526430229
D513, D514, D515, D516 = 15.697238121770845, -31.139403219565178, -9.35292435884448, 35.81684148639408
D61, D66, D67, D68 = 19.985053242002433, -387.0373087493518, -189.17813819516758, 527.8081592054236
D69, D610, D611, D612 = -11.57390253995963, 6.8812326946963, -1.0006050966910838, 0.7777137798053443
D613, D614, D615, D616 = -2.778205752353508, -60.19669523126412, 84.32040550667716, 11.99229113618279
D71, D76, D77, D78 = -25.69393346270375, -154.18974869023643, -231.5293791760455, 357.6391179106141
D79, D710, D711, D712 = 93.40532418362432, -37.45832313645163, 104.0996495089623, 29.8402934266605
D713, D714, D715, D716 = -43.53345659001114, 96.32455395918828, -39.17726167561544, -149.72683625798564


class Dop853:
    """One step, and the polynomial of degree 7 that keeps values and slopes of both its ends."""

    def __init__(self):
        self.v6 = self.v7 = self.v8 = self.v9 = self.v10 = self.v11 = self.v12 = 0.0  # speeds and accelerations
        self.a6 = self.a7 = self.a8 = self.a9 = self.a10 = self.a11 = self.a12 = 0.0  # at the stages
        self.p0 = self.p1 = self.p2 = self.p3 = self.p4 = self.p5 = self.p6 = self.p7 = 0.0  # the interpolant's
        self.q0 = self.q1 = self.q2 = self.q3 = self.q4 = self.q5 = self.q6 = self.q7 = 0.0  # coefficients

    def step(self, model, mode, t, x, v, a, h):
        """New x, v and acceleration, and the rates e_x, e_v of the error: the estimates are h e_x and h e_v."""
        y = x + h * (A21 * v)
        v2 = v + h * (A21 * a)
        a2 = model.acceleration(t + C2 * h, y, v2, mode)
        y = x + h * (A31 * v + A32 * v2)
        v3 = v + h * (A31 * a + A32 * a2)
        a3 = model.acceleration(t + C3 * h, y, v3, mode)
        y = x + h * (A41 * v + A43 * v3)
        v4 = v + h * (A41 * a + A43 * a3)
        a4 = model.acceleration(t + C4 * h, y, v4, mode)
        y = x + h * (A51 * v + A53 * v3 + A54 * v4)
        v5 = v + h * (A51 * a + A53 * a3 + A54 * a4)
        a5 = model.acceleration(t + C5 * h, y, v5, mode)
        y = x + h * (A61 * v + A64 * v4 + A65 * v5)
        v6 = v + h * (A61 * a + A64 * a4 + A65 * a5)
        a6 = model.acceleration(t + C6 * h, y, v6, mode)
        y = x + h * (A71 * v + A74 * v4 + A75 * v5 + A76 * v6)
        v7 = v + h * (A71 * a + A74 * a4 + A75 * a5 + A76 * a6)
        a7 = model.acceleration(t + C7 * h, y, v7, mode)
        y = x + h * (A81 * v + A84 * v4 + A85 * v5 + A86 * v6 + A87 * v7)
        v8 = v + h * (A81 * a + A84 * a4 + A85 * a5 + A86 * a6 + A87 * a7)
        a8 = model.acceleration(t + C8 * h, y, v8, mode)
        y = x + h * (A91 * v + A94 * v4 + A95 * v5 + A96 * v6 + A97 * v7 + A98 * v8)
        v9 = v + h * (A91 * a + A94 * a4 + A95 * a5 + A96 * a6 + A97 * a7 + A98 * a8)
        a9 = model.acceleration(t + C9 * h, y, v9, mode)
        y = x + h * (A101 * v + A104 * v4 + A105 * v5 + A106 * v6 + A107 * v7 + A108 * v8 + A109 * v9)
        v10 = v + h * (A101 * a + A104 * a4 + A105 * a5 + A106 * a6 + A107 * a7 + A108 * a8 + A109 * a9)
        a10 = model.acceleration(t + C10 * h, y, v10, mode)
        y = x + h * (A111 * v + A114 * v4 + A115 * v5 + A116 * v6 + A117 * v7 + A118 * v8 + A119 * v9 + A1110 * v10)
        v11 = v + h * (A111 * a + A114 * a4 + A115 * a5 + A116 * a6 + A117 * a7 + A118 * a8 + A119 * a9 + A1110 * a10)
        a11 = model.acceleration(t + C11 * h, y, v11, mode)
        y = A121 * v + A124 * v4 + A125 * v5 + A126 * v6 + A127 * v7
        y = x + h * (y + A128 * v8 + A129 * v9 + A1210 * v10 + A1211 * v11)
        v12 = A121 * a + A124 * a4 + A125 * a5 + A126 * a6 + A127 * a7
        v12 = v + h * (v12 + A128 * a8 + A129 * a9 + A1210 * a10 + A1211 * a11)
        a12 = model.acceleration(t + h, y, v12, mode)
        p = B1 * v + B6 * v6 + B7 * v7 + B8 * v8 + B9 * v9 + B10 * v10 + B11 * v11 + B12 * v12
        q = B1 * a + B6 * a6 + B7 * a7 + B8 * a8 + B9 * a9 + B10 * a10 + B11 * a11 + B12 * a12
        x1, v1 = x + h * p, v + h * q
        a1 = model.acceleration(t + h, x1, v1, mode)
        self.v6, self.v7, self.v8, self.v9, self.v10, self.v11, self.v12 = v6, v7, v8, v9, v10, v11, v12
        self.a6, self.a7, self.a8, self.a9, self.a10, self.a11, self.a12 = a6, a7, a8, a9, a10, a11, a12
        e_x = combine(
            ER1 * v + ER6 * v6 + ER7 * v7 + ER8 * v8 + ER9 * v9 + ER10 * v10 + ER11 * v11 + ER12 * v12,
            p - BHH1 * v - BHH2 * v9 - BHH3 * v12,
        )
        e_v = combine(
            ER1 * a + ER6 * a6 + ER7 * a7 + ER8 * a8 + ER9 * a9 + ER10 * a10 + ER11 * a11 + ER12 * a12,
            q - BHH1 * a - BHH2 * a9 - BHH3 * a12,
        )
        return x1, v1, a1, e_x, e_v

    def expand(self, model, mode, t, x, v, a, h, x1, v1, a1):
        """Coefficients of the interpolant of the step just taken."""
        v6, v7, v8, v9, v10, v11, v12 = self.v6, self.v7, self.v8, self.v9, self.v10, self.v11, self.v12
        a6, a7, a8, a9, a10, a11, a12 = self.a6, self.a7, self.a8, self.a9, self.a10, self.a11, self.a12
        y = A141 * v + A147 * v7 + A148 * v8 + A149 * v9
        y = x + h * (y + A1410 * v10 + A1411 * v11 + A1412 * v12 + A1413 * v1)
        v14 = A141 * a + A147 * a7 + A148 * a8 + A149 * a9
        v14 = v + h * (v14 + A1410 * a10 + A1411 * a11 + A1412 * a12 + A1413 * a1)
        a14 = model.acceleration(t + C14 * h, y, v14, mode)
        y = A151 * v + A156 * v6 + A157 * v7 + A158 * v8
        y = x + h * (y + A1511 * v11 + A1512 * v12 + A1513 * v1 + A1514 * v14)
        v15 = A151 * a + A156 * a6 + A157 * a7 + A158 * a8
        v15 = v + h * (v15 + A1511 * a11 + A1512 * a12 + A1513 * a1 + A1514 * a14)
        a15 = model.acceleration(t + C15 * h, y, v15, mode)
        y = x + h * (A161 * v + A166 * v6 + A167 * v7 + A168 * v8 + A169 * v9 + A1613 * v1 + A1614 * v14 + A1615 * v15)
        v16 = A161 * a + A166 * a6 + A167 * a7 + A168 * a8
        v16 = v + h * (v16 + A169 * a9 + A1613 * a1 + A1614 * a14 + A1615 * a15)
        a16 = model.acceleration(t + C16 * h, y, v16, mode)
        p = x1 - x
        self.p0, self.p1, self.p2, self.p3 = x, p, h * v - p, 2.0 * p - h * (v + v1)
        p = D41 * v + D46 * v6 + D47 * v7 + D48 * v8 + D49 * v9 + D410 * v10
        self.p4 = h * (p + D411 * v11 + D412 * v12 + D413 * v1 + D414 * v14 + D415 * v15 + D416 * v16)
        p = D51 * v + D56 * v6 + D57 * v7 + D58 * v8 + D59 * v9 + D510 * v10
        self.p5 = h * (p + D511 * v11 + D512 * v12 + D513 * v1 + D514 * v14 + D515 * v15 + D516 * v16)
        p = D61 * v + D66 * v6 + D67 * v7 + D68 * v8 + D69 * v9 + D610 * v10
        self.p6 = h * (p + D611 * v11 + D612 * v12 + D613 * v1 + D614 * v14 + D615 * v15 + D616 * v16)
        p = D71 * v + D76 * v6 + D77 * v7 + D78 * v8 + D79 * v9 + D710 * v10
        self.p7 = h * (p + D711 * v11 + D712 * v12 + D713 * v1 + D714 * v14 + D715 * v15 + D716 * v16)
        p = v1 - v
        self.q0, self.q1, self.q2, self.q3 = v, p, h * a - p, 2.0 * p - h * (a + a1)
        p = D41 * a + D46 * a6 + D47 * a7 + D48 * a8 + D49 * a9 + D410 * a10
        self.q4 = h * (p + D411 * a11 + D412 * a12 + D413 * a1 + D414 * a14 + D415 * a15 + D416 * a16)
        p = D51 * a + D56 * a6 + D57 * a7 + D58 * a8 + D59 * a9 + D510 * a10
        self.q5 = h * (p + D511 * a11 + D512 * a12 + D513 * a1 + D514 * a14 + D515 * a15 + D516 * a16)
        p = D61 * a + D66 * a6 + D67 * a7 + D68 * a8 + D69 * a9 + D610 * a10
        self.q6 = h * (p + D611 * a11 + D612 * a12 + D613 * a1 + D614 * a14 + D615 * a15 + D616 * a16)
        p = D71 * a + D76 * a6 + D77 * a7 + D78 * a8 + D79 * a9 + D710 * a10
        self.q7 = h * (p + D711 * a11 + D712 * a12 + D713 * a1 + D714 * a14 + D715 * a15 + D716 * a16)

    def at(self, s):
        """Position and speed at the fraction s of the step."""
        r = 1.0 - s
        p = self.p3 + r * (self.p4 + s * (self.p5 + r * (self.p6 + s * self.p7)))
        q = self.q3 + r * (self.q4 + s * (self.q5 + r * (self.q6 + s * self.q7)))
        return self.p0 + s * (self.p1 + r * (self.p2 + s * p)), self.q0 + s * (self.q1 + r * (self.q2 + s * q))


def combine(fifth, third):
    """The rate of the error from the two embedded formulas, of order 5 and of order 3."""
    size = fifth * fifth + 0.01 * third * third
    return fifth * fifth / sqrt(size) if size != 0.0 else 0.0
