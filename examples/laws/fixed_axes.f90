! Orthotropic elasticity with axes that are fixed in space, as a UMAT: small strain, and not objective.
! The tangent is right without rotation, and wrong where the body turns, because the axes stay.
! PROPS: C11, C22, C33, C12, C13, C23, then the shear moduli of 12, 13, 23. No STATEV. NTENS is 6.
! DDSDDE: d stress / d DSTRAN.
subroutine umat(stress, statev, ddsdde, sse, spd, scd, rpl, ddsddt, drplde, drpldt, stran, dstran, time, dtime, &
    temp, dtemp, predef, dpred, cmname, ndi, nshr, ntens, nstatv, props, nprops, coords, drot, pnewdt, celent, &
    dfgrd0, dfgrd1, noel, npt, layer, kspt, jstep, kinc)
  implicit none
  integer :: ndi, nshr, ntens, nstatv, nprops, noel, npt, layer, kspt, jstep(4), kinc, i
  double precision :: stress(ntens), statev(nstatv), ddsdde(ntens, ntens), sse, spd, scd, rpl, ddsddt(ntens)
  double precision :: drplde(ntens), drpldt, stran(ntens), dstran(ntens), time(2), dtime, temp, dtemp, predef(1)
  double precision :: dpred(1), props(nprops), coords(3), drot(3, 3), pnewdt, celent, dfgrd0(3, 3), dfgrd1(3, 3)
  character(len=80) :: cmname

  ddsdde = 0
  do i = 1, 3
    ddsdde(i, i) = props(i)
    ddsdde(3 + i, 3 + i) = props(6 + i)
  end do
  ddsdde(1, 2) = props(4)
  ddsdde(1, 3) = props(5)
  ddsdde(2, 3) = props(6)
  ddsdde(2, 1) = props(4)
  ddsdde(3, 1) = props(5)
  ddsdde(3, 2) = props(6)
  stress = stress + matmul(ddsdde, dstran)
end subroutine
