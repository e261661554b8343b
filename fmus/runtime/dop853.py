"""Dormand-Prince 8(5,3) of E. Hairer: local extrapolation, first same as last, interpolant of order 7.

E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I, II.5, II.6 and II.10, and the program
DOP853: its coefficients in double precision under the same names (A1210: stage 12, slope 10).
"""

from math import sqrt

from .codes import STUCK
from .vectors import ContactVector, StateVector, elementwise

NUMBER, TEXT = 4, "Dormand-Prince 8(5,3); for tight tolerances"
STAGES = 12  # evaluations of the right-hand side in a step; the last one serves the next step
EXTRA = 3  # additional evaluations for the interpolant
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
    """Method with an interpolant of degree 7 that matches values and slopes at both ends."""

    f6: StateVector
    f7: StateVector
    f8: StateVector
    f9: StateVector
    f10: StateVector
    f11: StateVector
    f12: StateVector

    def __init__(self):
        self.f6 = self.f7 = self.f8 = self.f9 = self.f10 = self.f11 = self.f12 = 0.0

    def propose(
        self, model, step, modes: ContactVector, t, y: StateVector, f: StateVector, h
    ) -> tuple[StateVector, StateVector, StateVector]:
        """Propose a step of size h: return the new state, its rates, and e, where h e estimates the error."""
        y2 = y + h * (A21 * f)
        f2 = model.rates(t + C2 * h, y2, modes)
        y3 = y + h * (A31 * f + A32 * f2)
        f3 = model.rates(t + C3 * h, y3, modes)
        y4 = y + h * (A41 * f + A43 * f3)
        f4 = model.rates(t + C4 * h, y4, modes)
        y5 = y + h * (A51 * f + A53 * f3 + A54 * f4)
        f5 = model.rates(t + C5 * h, y5, modes)
        y6 = y + h * (A61 * f + A64 * f4 + A65 * f5)
        f6 = model.rates(t + C6 * h, y6, modes)
        y7 = y + h * (A71 * f + A74 * f4 + A75 * f5 + A76 * f6)
        f7 = model.rates(t + C7 * h, y7, modes)
        y8 = y + h * (A81 * f + A84 * f4 + A85 * f5 + A86 * f6 + A87 * f7)
        f8 = model.rates(t + C8 * h, y8, modes)
        y9 = y + h * (A91 * f + A94 * f4 + A95 * f5 + A96 * f6 + A97 * f7 + A98 * f8)
        f9 = model.rates(t + C9 * h, y9, modes)
        y10 = y + h * (A101 * f + A104 * f4 + A105 * f5 + A106 * f6 + A107 * f7 + A108 * f8 + A109 * f9)
        f10 = model.rates(t + C10 * h, y10, modes)
        y11 = y + h * (A111 * f + A114 * f4 + A115 * f5 + A116 * f6 + A117 * f7 + A118 * f8 + A119 * f9 + A1110 * f10)
        f11 = model.rates(t + C11 * h, y11, modes)
        u = A121 * f + A124 * f4 + A125 * f5 + A126 * f6 + A127 * f7
        y12 = y + h * (u + A128 * f8 + A129 * f9 + A1210 * f10 + A1211 * f11)
        f12 = model.rates(t + h, y12, modes)
        u = B1 * f + B6 * f6 + B7 * f7 + B8 * f8 + B9 * f9 + B10 * f10 + B11 * f11 + B12 * f12
        y1 = y + h * u
        f1 = model.rates(t + h, y1, modes)
        self.f6, self.f7, self.f8, self.f9, self.f10, self.f11, self.f12 = f6, f7, f8, f9, f10, f11, f12
        e5 = ER1 * f + ER6 * f6 + ER7 * f7 + ER8 * f8 + ER9 * f9 + ER10 * f10 + ER11 * f11 + ER12 * f12
        e3 = u - BHH1 * f - BHH2 * f9 - BHH3 * f12
        e = combine_errors(e5, e3)
        return y1, f1, e

    def build_interpolant(self, model, step):
        """Build the interpolant of the step just computed."""
        interpolant = step.interpolant
        h, modes, t, y, f, y1, f1 = step.h_full, step.modes0, step.t0, step.y0, step.f0, step.y1, step.f1  # noqa: F841
        if model.has_other_laws and not step.is_hybrid:
            modes = STUCK * modes
        f6, f7, f8, f9, f10, f11, f12 = self.f6, self.f7, self.f8, self.f9, self.f10, self.f11, self.f12
        u = A141 * f + A147 * f7 + A148 * f8 + A149 * f9
        y14 = y + h * (u + A1410 * f10 + A1411 * f11 + A1412 * f12 + A1413 * f1)
        f14 = model.rates(t + C14 * h, y14, modes)
        u = A151 * f + A156 * f6 + A157 * f7 + A158 * f8
        y15 = y + h * (u + A1511 * f11 + A1512 * f12 + A1513 * f1 + A1514 * f14)
        f15 = model.rates(t + C15 * h, y15, modes)
        u = A161 * f + A166 * f6 + A167 * f7 + A168 * f8
        y16 = y + h * (u + A169 * f9 + A1613 * f1 + A1614 * f14 + A1615 * f15)
        f16 = model.rates(t + C16 * h, y16, modes)
        interpolant.set_hermite_cubic(step)
        interpolant.degree = 7
        u = D41 * f + D46 * f6 + D47 * f7 + D48 * f8 + D49 * f9 + D410 * f10
        interpolant.c4 = h * (u + D411 * f11 + D412 * f12 + D413 * f1 + D414 * f14 + D415 * f15 + D416 * f16)
        u = D51 * f + D56 * f6 + D57 * f7 + D58 * f8 + D59 * f9 + D510 * f10
        interpolant.c5 = h * (u + D511 * f11 + D512 * f12 + D513 * f1 + D514 * f14 + D515 * f15 + D516 * f16)
        u = D61 * f + D66 * f6 + D67 * f7 + D68 * f8 + D69 * f9 + D610 * f10
        interpolant.c6 = h * (u + D611 * f11 + D612 * f12 + D613 * f1 + D614 * f14 + D615 * f15 + D616 * f16)
        u = D71 * f + D76 * f6 + D77 * f7 + D78 * f8 + D79 * f9 + D710 * f10
        interpolant.c7 = h * (u + D711 * f11 + D712 * f12 + D713 * f1 + D714 * f14 + D715 * f15 + D716 * f16)


@elementwise
def combine_errors(fifth, third):
    """Combine the errors of the embedded formulas of orders 5 and 3 into the estimate of DOP853, per unit of h."""
    size = fifth * fifth + 0.01 * third * third
    return fifth * fifth / sqrt(size) if size != 0.0 else 0.0
